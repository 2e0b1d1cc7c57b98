"""A force-torque sensor at the wrist, with noise, an offset (tare) and a low-pass filter.

The sensor measures the wrench that the arm exerts on its hand. The external wrench, of the surroundings on the hand and
the held parts, is the known weights minus this reading. The robot knows the weight of the hand from its own model, and
that of a part from the part file and its estimated pose in the hand. Its encoders give the orientation of the hand.
Inertial forces are not compensated: a hand of 1 kg that accelerates at 1 m/s^2 shows 1 N.
"""

import copy
import math
from collections.abc import Callable, Mapping
from typing import NamedTuple, final

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.records import FtNoise
from apo_bench.scenario.parts import read_part
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.frames import body_frame
from apo_bench.simulation.robot.forces import Guard, low_pass_weights
from apo_bench.simulation.robot.gripper import open_hand
from apo_bench.simulation.scene import WRIST_SENSORS, Scene

READING_S = 0.001
"""Time between readings. Each is the mean over this time plus new noise, whatever the physics step."""
BANDWIDTH_HZ = 16.0
"""Cutoff of the low-pass filter: a time constant of 10 ms, which leaves 0.22 of the noise of a reading."""
OFFSETS = 20.0
"""Standard deviation of the offset of a sensor before it is zeroed, in standard deviations of its noise."""
_OFF = (0.3, 0.015)
"""Least wrench in free air that is no noise, [N] and [Nm]: slip of a part in the hand shifts its weight by less."""
_OFF_SIGMAS = 6.0  # the same in standard deviations of the filtered noise
_GRAVITY = 9.81  # [m/s^2]
_ROUNDING_S = 1e-9  # tolerance for sums of physics steps


class Load(NamedTuple):
    """A mass that hangs on the sensor: the hand, or a part in it."""

    mass_kg: float
    center: Array
    """Centre of mass, (3,), in the frame of the tip, [m]."""


def hand_load(kinematics: Kinematics, opening: float) -> Load:
    """Return mass and centre of the hand at an opening of each finger, [m], from the model of the arm alone."""
    data, T_tip = open_hand(kinematics, opening)
    mount = kinematics.model.body(kinematics.arm.mount).id
    center = T_tip[:3, :3].T @ (data.subtree_com[mount] - T_tip[:3, 3])
    return Load(float(kinematics.model.body_subtreemass[mount]), center)


def compute_part_loads(scene: Scene, T_tip_part: Mapping[str, Array]) -> tuple[Load, ...]:
    """Return the loads of held parts, with densities from their part files.

    Args:
        T_tip_part: Estimated pose of each part in the frame of the tip, (4, 4).
    """
    loads = []
    for part, T in T_tip_part.items():
        solid = scene.scenario.assembly.solids[part]
        mass = read_part(scene.scenario.part_files[part]).density * solid.volume
        loads.append(Load(mass, T[:3, :3] @ solid.centroid + T[:3, 3]))
    return tuple(loads)


def compute_low_pass_gain(bandwidth_hz: float = BANDWIDTH_HZ) -> float:
    """Return the gain a of the low pass y' = (1 - a) y + a x, called once per reading x."""
    return 1.0 - math.exp(-2.0 * math.pi * bandwidth_hz * READING_S)


def filter_noise(noise: FtNoise, part: float) -> FtNoise:
    """Return the standard deviations of noise behind a low pass.

    The output of y' = (1 - a) y + a x has a / (2 - a) times the variance of the white noise x.

    Args:
        noise: Standard deviations of a reading.
        part: The gain a, from `compute_low_pass_gain`.
    """
    left = math.sqrt(part / (2.0 - part))
    return FtNoise(left * noise.force_n, left * noise.torque_nm)


def _no_drift() -> Array:
    """Return the drift of a sensor that does not drift."""
    return np.zeros(1)


@final
class WristSensor:
    """The sensor at the wrist of one arm during one replay."""

    def __init__(
        self,
        scene: Scene,
        sensordata: Array,
        encoders: Callable[[], Array],
        noise: FtNoise,
        rng: np.random.Generator,
        bandwidth_hz: float = BANDWIDTH_HZ,
        drift: Callable[[], Array] = _no_drift,
    ) -> None:
        """Draw the offset of the trial.

        Args:
            scene: The scene whose robot has the sensor.
            sensordata: `MjData.sensordata` of the simulation; a view of its wrist sensors is read at each step.
            encoders: Returns the measured joint angles, (joints,), [rad].
            noise: Standard deviations of a reading, per axis.
            rng: Source of six numbers now and six at each reading.
            bandwidth_hz: Cutoff frequency of the low pass.
            drift: Returns how far the offset has drifted, (6,), [N] and [Nm].
        """
        first = [int(scene.work.model.sensor_adr[scene.work.model.sensor(name).id]) for name in WRIST_SENSORS]
        self._raw_at = first[0]
        self._raw = sensordata[first[0] : first[1] + 3]  # force, then torque, in the frame of the sensor
        self._kinematics = scene.kinematics
        self._encoders = encoders
        self._sigma = np.repeat(noise, 3)
        self._rng = rng
        self._part = compute_low_pass_gain(bandwidth_hz)
        self._offset = OFFSETS * self._sigma * rng.standard_normal(6)
        self._drift = drift
        self._zero: Array = np.zeros(6)
        self.drifts = False
        """Whether the sensor was found to drift, so that it is zeroed before each guarded motion."""
        data, T_tip = open_hand(scene.kinematics, scene.arm.opening_m)
        mount = body_frame(data, scene.kinematics.model.body(scene.arm.mount).id)
        self._T_tip_sensor = pose.inverse(T_tip) @ mount  # both are on the same rigid body
        self._sum: Array = np.zeros(6)
        self._summed_s = 0.0
        self._clock_s = 0.0
        self._filtered: Array | None = None
        self._readings: list[Array] | None = None
        self._hand = hand_load(scene.kinematics, scene.arm.opening_m)
        self._held: tuple[Load, ...] = ()
        self._weights: Array = np.zeros((6, 3))
        self.hold()

    @property
    def sigma(self) -> tuple[float, float]:
        """Standard deviations of force and torque behind the low pass, per axis, [N] and [Nm]."""
        return filter_noise(FtNoise(*self._sigma[[0, 3]].tolist()), self._part)

    def hold(self, *parts: Load) -> None:
        """Set the held parts, from `compute_part_loads`, whose weight is compensated; none for an empty hand."""
        self._held = parts
        T = pose.inverse(self._T_tip_sensor)
        loads = (self._hand, *parts)
        mass = sum(load.mass_kg for load in loads)
        moment = sum((load.mass_kg * (T[:3, :3] @ load.center + T[:3, 3]) for load in loads), np.zeros(3))
        # The arm carries each weight, m g upwards at its centre c: a force m g up, and a torque m c x g up.
        # `_weights`, (6, 3), maps the up direction, in the frame of the sensor, to this wrench.
        self._weights = _GRAVITY * np.vstack([mass * np.eye(3), pose.hat(moment)])

    def begin(self, hand: Load) -> None:
        """Restart the filter after a time without readings: the next reading is taken unfiltered.

        Args:
            hand: The hand at its present opening, from `hand_load`.
        """
        self._hand = hand
        self.hold(*self._held)
        self._sum = np.zeros(6)
        self._summed_s = self._clock_s = 0.0
        self._filtered = None

    def take(self, step_s: float) -> bool:
        """Add the sensor data of the last physics step, which lasted `step_s`; return whether a reading is complete."""
        return self._add(self._raw, step_s)

    def _add(self, raw: Array, step_s: float) -> bool:
        """Add the sensor data of a physics step, (6,); return whether a reading is complete."""
        self._sum += step_s * raw
        self._summed_s += step_s
        self._clock_s += step_s
        if self._clock_s < READING_S - _ROUNDING_S:
            return False
        offset = self._offset + self._drift()
        reading = self._sum / self._summed_s + offset + self._sigma * self._rng.standard_normal(6)
        self._sum[:] = 0.0
        self._summed_s = 0.0
        self._clock_s -= READING_S
        self._filtered = reading if self._filtered is None else self._filtered + self._part * (reading - self._filtered)
        if self._readings is not None:
            self._readings.append(reading)
        return True

    @property
    def raw(self) -> Array:
        """Force and torque after the last physics step, (6,), in the frame of the sensor: a view."""
        return self._raw

    def take_rows(self, rows: Array, step_s: float) -> None:
        """Add the sensor data of several physics steps, (k, 6), which lasted `step_s` each."""
        if self._readings is not None or self._clock_s or abs(step_s - READING_S) > _ROUNDING_S:
            for row in rows:
                self._add(row, step_s)
            return
        readings = rows + self._offset + self._drift() + self._sigma * self._rng.standard_normal(rows.shape)
        before = readings[0] if self._filtered is None else self._filtered
        decay, weights = low_pass_weights(len(rows), self._part)
        self._filtered = decay[-1] * before + weights[-1] @ readings

    def at(self, sensordata: Array, encoders: Callable[[], Array], rng: np.random.Generator) -> "WristSensor":
        """Return a copy, with the same offset and tare but no drift, for another simulation of its robot.

        Args:
            sensordata, encoders, rng: As for the constructor.
        """
        other = copy.copy(self)
        other._raw = sensordata[self._raw_at : self._raw_at + 6]
        other._encoders = encoders
        other._rng = rng
        other._offset = self._offset + self._drift()
        other._drift = _no_drift
        other.begin(self._hand)
        return other

    @property
    def is_off(self) -> bool:
        """Whether the sensor, in free air, reads more than an external wrench of zero with its noise."""
        wrench = np.abs(self.wrench_there()).reshape(2, 3).max(axis=1)
        return bool((wrench > np.maximum(_OFF, _OFF_SIGMAS * np.array(self.sigma))).any())

    def start_zero(self) -> None:
        """Start to collect readings for `end_zero`, while the arm stands still in free air."""
        self._readings = []

    def end_zero(self) -> None:
        """Tare the sensor: the mean reading since `start_zero`, less the known weights, is its offset."""
        if self._readings:
            # Row 2 of the sensor's rotation is the up direction in its own frame.
            self._zero = np.mean(self._readings, axis=0) - self._weights @ self._sensor()[2, :3]
        self._readings = None

    def wrench(self, about: Array) -> Array:
        """Return the filtered external wrench on the hand and the held parts.

        Args:
            about: The point to which the torque refers, (3,), world, [m].

        Returns:
            Force, [N], and torque, [Nm], (6,), along world axes; zero before the first reading.
        """
        if self._filtered is None:
            return np.zeros(6)
        T = self._sensor()
        out = (self._weights @ T[2, :3] + self._zero - self._filtered).reshape(2, 3) @ T[:3, :3].T
        f, t = out  # views, so the next line changes `out`
        t += pose.hat(T[:3, 3] - about) @ f
        return np.asarray(out.ravel())

    def wrench_there(self) -> Array:
        """Return `wrench` about the origin of the sensor, at the flange."""
        return self.wrench(self._sensor()[:3, 3])

    def stops(self, guard: Guard | None) -> bool:
        """Whether the external force against the direction of the guard exceeds its limit; False without a guard."""
        if guard is None:
            return False
        return -float(self.wrench(np.zeros(3))[:3] @ guard.direction) > guard.newton

    def _sensor(self) -> Array:
        """Return the pose of the sensor by the encoders, (4, 4), world."""
        return np.asarray(self._kinematics.forward(self._encoders()) @ self._T_tip_sensor)
