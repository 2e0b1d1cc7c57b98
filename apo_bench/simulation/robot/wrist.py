"""A sensor of force and torque at the wrist, with noise, an offset and a low pass.

It measures what the arm exerts on its hand. What the surroundings exert on the hand, and on what is in it, is that, the
other way round, less the weights. The robot knows the weight of its hand by its own model, that of a part by the part
file and its estimated pose in the hand, and how the hand is turned by its encoders. Inertia stays in: a hand of 1 kg
that gains 1 m/s in a second shows 1 N.
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
from apo_bench.simulation.robot.forces import Guard
from apo_bench.simulation.robot.gripper import open_hand
from apo_bench.simulation.scene import WRIST_SENSORS, Scene

READING_S = 0.001
"""Time from one reading to the next. Each is the mean since the one before, with new noise, whatever the step."""
BANDWIDTH_HZ = 16.0
"""Of the low pass, a time constant of 10 ms: so late a force is known, and the noise of a reading is 0.22 times."""
OFFSETS = 20.0
"""Standard deviation of what a sensor shows of nothing until it is zeroed, in standard deviations of its noise."""
_GRAVITY = 9.81
_ROUNDING_S = 1e-9


class Load(NamedTuple):
    """What hangs on the sensor."""

    mass_kg: float
    center: Array
    """Its centre of mass, (3,), in the frame of the tip, [m]."""


def hand_load(kinematics: Kinematics, opening: float) -> Load:
    """The hand at an opening [m], by the model of the arm alone."""
    data, T_tip = open_hand(kinematics, opening)
    mount = kinematics.model.body(kinematics.arm.mount).id
    center = T_tip[:3, :3].T @ (data.subtree_com[mount] - T_tip[:3, 3])
    return Load(float(kinematics.model.body_subtreemass[mount]), center)


def compute_part_loads(scene: Scene, T_tip_part: Mapping[str, Array]) -> tuple[Load, ...]:
    """Parts by their files, each (4, 4) at its estimated pose in the hand."""
    loads = []
    for part, T in T_tip_part.items():
        solid = scene.scenario.assembly.solids[part]
        mass = read_part(scene.scenario.part_files[part]).density * solid.volume
        loads.append(Load(mass, T[:3, :3] @ solid.centroid + T[:3, 3]))
    return tuple(loads)


def compute_low_pass_gain(bandwidth_hz: float = BANDWIDTH_HZ) -> float:
    """How much of a new reading goes into the filtered one."""
    return 1.0 - math.exp(-2.0 * math.pi * bandwidth_hz * READING_S)


def filter_noise(noise: FtNoise, part: float) -> FtNoise:
    """What a low pass leaves of the noise: y' = (1 - a) y + a x has the variance a / (2 - a) of the white noise x.

    Args:
        part: a, how much of a new reading goes into the filtered one.
    """
    left = math.sqrt(part / (2.0 - part))
    return FtNoise(left * noise.force_n, left * noise.torque_nm)


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
    ) -> None:
        """Draw the offset of the trial.

        Args:
            sensordata: That of the simulation; of it, the sensors of the wrist are read.
            encoders: What the joints' encoders say, (joints,), [rad].
            rng: Six numbers now, and six at each reading.
        """
        first = [int(scene.work.model.sensor_adr[scene.work.model.sensor(name).id]) for name in WRIST_SENSORS]
        self._raw_at = first[0]
        self._raw = sensordata[first[0] : first[1] + 3]
        self._kinematics = scene.kinematics
        self._encoders = encoders
        self._sigma = np.repeat(noise, 3)
        self._rng = rng
        self._part = compute_low_pass_gain(bandwidth_hz)
        self._offset = OFFSETS * self._sigma * rng.standard_normal(6)
        self._zero: Array = np.zeros(6)
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
        """Standard deviation behind the low pass, per axis, [N] and [Nm]."""
        return filter_noise(FtNoise(*self._sigma[[0, 3]].tolist()), self._part)

    def hold(self, *parts: Load) -> None:
        """Set what is in the hand, or nothing, by its estimate (`compute_part_loads`), whose weight is subtracted."""
        self._held = parts
        T = pose.inverse(self._T_tip_sensor)
        loads = (self._hand, *parts)
        mass = sum(load.mass_kg for load in loads)
        moment = sum((load.mass_kg * (T[:3, :3] @ load.center + T[:3, 3]) for load in loads), np.zeros(3))
        # The arm carries each weight, m g upwards at its centre c: a force m g up, and a torque m c x g up.
        self._weights = _GRAVITY * np.vstack([mass * np.eye(3), pose.hat(moment)])

    def begin(self, hand: Load) -> None:
        """Begin again after time in which nothing was read: the first reading is taken as it is."""
        self._hand = hand
        self.hold(*self._held)
        self._sum = np.zeros(6)
        self._summed_s = self._clock_s = 0.0
        self._filtered = None

    def take(self, step_s: float) -> bool:
        """Take up what the last physics step left in the sensors; whether that made a reading."""
        self._sum += step_s * self._raw
        self._summed_s += step_s
        self._clock_s += step_s
        if self._clock_s < READING_S - _ROUNDING_S:
            return False
        reading = self._sum / self._summed_s + self._offset + self._sigma * self._rng.standard_normal(6)
        self._sum[:] = 0.0
        self._summed_s = 0.0
        self._clock_s -= READING_S
        self._filtered = reading if self._filtered is None else self._filtered + self._part * (reading - self._filtered)
        if self._readings is not None:
            self._readings.append(reading)
        return True

    def at(self, sensordata: Array, encoders: Callable[[], Array], rng: np.random.Generator) -> "WristSensor":
        """The same sensor, as it is zeroed, in another simulation of its robot and with other noise."""
        other = copy.copy(self)
        other._raw = sensordata[self._raw_at : self._raw_at + 6]
        other._encoders = encoders
        other._rng = rng
        other.begin(self._hand)
        return other

    def start_zero(self) -> None:
        """From now on the arm stands still in free air."""
        self._readings = []

    def end_zero(self) -> None:
        """What the readings since `start_zero` show on average, but for the weights, is no force of anything."""
        if self._readings:
            self._zero = np.mean(self._readings, axis=0) - self._weights @ self._sensor()[2, :3]
        self._readings = None

    def wrench(self, about: Array) -> Array:
        """Force and torque about a point, (3,) world, of the surroundings on the hand and what is in it, filtered.

        Returns:
            (6,): [N] and [Nm], along world axes; zero before the first reading.
        """
        if self._filtered is None:
            return np.zeros(6)
        T = self._sensor()
        out = (self._weights @ T[2, :3] + self._zero - self._filtered).reshape(2, 3) @ T[:3, :3].T
        f, t = out
        t += pose.hat(T[:3, 3] - about) @ f
        return np.asarray(out.ravel())

    def wrench_there(self) -> Array:
        """As `wrench`, about the sensor itself: the flange."""
        return self.wrench(self._sensor()[:3, 3])

    def stops(self, guard: Guard | None) -> bool:
        """Whether the hand is pushed back along the way of a guard by more than it allows."""
        if guard is None:
            return False
        return -float(self.wrench(np.zeros(3))[:3] @ guard.direction) > guard.newton

    def _sensor(self) -> Array:
        """Where the sensor is by the encoders, (4, 4), world."""
        return np.asarray(self._kinematics.forward(self._encoders()) @ self._T_tip_sensor)
