"""A sensor of force and torque at the wrist, as arms have it: noise, an offset, a low pass, and what it cannot know.

It measures what the arm exerts on its hand. What the surroundings exert on the hand, and on what is in it, is that, the
other way round, less the weights. The robot knows the weight of its hand by its own model, that of a part by the file
of the part where it believes it to be, and how the hand is turned by its encoders. Inertia stays in: a hand of 1 kg
that gains 1 m/s in a second feels 1 N.

What the robot feels: the force on what is in its hand, behind a filter, and what the arm strikes.
"""

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, final

import mujoco
import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.records import FtNoise
from apo_bench.scenario.parts import read_part
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.frames import body_frame, frame
from apo_bench.simulation.scene import WRIST_SENSORS, Scene, World

WRIST_S = 0.02
"""Time constant of the sensor at the wrist (8 Hz). Where hard parts touch, the force of a single step nearly doubles
when the step is halved, while its impulse stays; behind the filter it hardly depends on the step. Real sensors of force
are read behind filters of 5 to 70 Hz for the same reason."""
_COLLISION_N = 20.0
"""An arm that strikes a part it does not hold harder than this has made a protective stop."""


class LowPass:
    """A first-order filter, y' = (x - y) / time constant. Plain numbers, since arrays this small are slow."""

    def __init__(self, time_constant_s: float) -> None:
        self._time_constant_s = time_constant_s
        self.force = [0.0, 0.0, 0.0]

    def __call__(self, force: Sequence[float], seconds: float) -> list[float]:
        """The filtered force, (3,), [N], after one that was felt for so long; at most the time constant."""
        part = seconds / self._time_constant_s
        x, y, z = self.force
        fx, fy, fz = force
        self.force = [x + (fx - x) * part, y + (fy - y) * part, z + (fz - z) * part]
        return self.force


class Guard(NamedTuple):
    """Stop when the held part is pushed back along `way` by more than `newton`."""

    way: Array
    newton: float


class ForceSensors:
    """The contact sensors of a scene, as the robot reads them.

    The scene has, first for each movable part, what the part exerts on all that it touches; then, for each part, what
    it exerts on the arm; three numbers each. The sensors of the wrist, which come last, are none of them.
    """

    def __init__(self, work: World, sensordata: Array) -> None:
        self._free = work.free
        self._names = (*work.free, *work.fixed)
        contacts = sensordata[: 3 * (len(work.free) + len(self._names))]
        self._sensors = contacts
        self._on_arm_flat = contacts[3 * len(work.free) :]
        self._on_arm = self._on_arm_flat.reshape(-1, 3)
        self._net_of_sensors = np.zeros((3, len(contacts)))
        self._net = np.zeros(3)
        self._handled: int | None = None
        self.held: tuple[str, ...] = ()
        self.wrist = LowPass(WRIST_S)
        self.peak_n = 0.0
        """The largest that the sensor at the wrist has shown."""

    def hold(self, *parts: str) -> None:
        """Say which parts are in the hand: the held one and what it carries, or none."""
        self.held = parts
        self.wrist = LowPass(WRIST_S)
        # The force on a part is that of its own sensor, the other way round, less what the arm exerts on it; what the
        # parts of a group exert on each other cancels in the sum over the group.
        self._net_of_sensors = np.zeros_like(self._net_of_sensors)
        for i in map(self._free.index, parts):
            on_arm = 3 * (len(self._free) + i)
            self._net_of_sensors[:, on_arm : on_arm + 3] += np.eye(3)
            self._net_of_sensors[:, 3 * i : 3 * i + 3] -= np.eye(3)

    def handle(self, part: str | None) -> None:
        """Say which part the fingers may touch."""
        self._handled = None if part is None else self._free.index(part)

    def net(self) -> list[float]:
        """The net force of everything but the gripper on what is in the hand, (3,) world, [N]."""
        net: list[float] = np.dot(self._net_of_sensors, self._sensors, self._net).tolist()
        return net

    def feel(self, step_s: float) -> list[float]:
        """The net force in the last step, (3,) world, [N]; the sensor at the wrist takes it up."""
        force = self.net()
        self.peak_n = max(self.peak_n, math.hypot(*self.wrist(force, step_s)))
        return force

    def load(self) -> float:
        """The weight that the gripper feels, [N]: of the held part and of what really hangs on it."""
        return -float(self._on_arm[:, 2].sum())

    def struck(self) -> str | None:
        """The part that the arm strikes too hard without handling it."""
        if self._on_arm_flat @ self._on_arm_flat <= _COLLISION_N**2:
            return None
        squares = (self._on_arm * self._on_arm).sum(axis=1)
        if self._handled is not None:
            squares[self._handled] = 0.0
        hardest = int(squares.argmax())
        return self._names[hardest] if math.sqrt(squares[hardest]) > _COLLISION_N else None

    def memory(self) -> tuple[Any, ...]:
        """What is remembered from step to step, for `remember`."""
        return self.held, self._handled, self.wrist.force, self.peak_n

    def remember(self, memory: tuple[Any, ...]) -> None:
        """Go on from where a `memory` was made."""
        held, self._handled, force, self.peak_n = memory
        self.hold(*held)
        self.wrist.force = force


READING_S = 0.001
"""Time from one reading to the next. Each is the mean since the one before, with new noise, whatever the step."""
BANDWIDTH_HZ = 16.0
"""Of the low pass, a time constant of 10 ms: so much the robot feels late, and a reading's noise is 0.22 times."""
OFFSETS = 20.0
"""Standard deviation of what a sensor shows of nothing until it is zeroed, in standard deviations of its noise."""
_GRAVITY = 9.81
_ROUNDING_S = 1e-9


class Load(NamedTuple):
    """What hangs on the sensor."""

    mass_kg: float
    center: Array
    """Its centre of mass, (3,), in the frame of the tip, [m]."""


def hand_load(kinematics: Kinematics, arm: Arm, opening: float) -> Load:
    """The hand at an opening [m], by the model of the arm alone."""
    model = kinematics.model
    data = mujoco.MjData(model)
    for finger, joint in zip(arm.fingers, arm.finger_joints(opening), strict=True):
        data.qpos[model.jnt_qposadr[model.joint(finger).id]] = joint
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mount = model.body(arm.mount).id
    tip = model.site(arm.tip).id
    center = data.site_xmat[tip].reshape(3, 3).T @ (data.subtree_com[mount] - data.site_xpos[tip])
    return Load(float(model.body_subtreemass[mount]), center)


def part_loads(scene: Scene, T_tip_part: Mapping[str, Array]) -> tuple[Load, ...]:
    """Parts by their files, each (4, 4) where it is believed to lie in the hand."""
    loads = []
    for part, T in T_tip_part.items():
        solid = scene.scenario.assembly.solids[part]
        mass = read_part(scene.scenario.part_files[part]).density * solid.volume
        loads.append(Load(mass, T[:3, :3] @ solid.centroid + T[:3, 3]))
    return tuple(loads)


def low_pass_part(bandwidth_hz: float = BANDWIDTH_HZ) -> float:
    """How much of a new reading goes into what is felt."""
    return 1.0 - math.exp(-2.0 * math.pi * bandwidth_hz * READING_S)


def felt_noise(noise: FtNoise, part: float) -> FtNoise:
    """What a low pass leaves of the noise: y' = (1 - a) y + a x has the variance a / (2 - a) of the white noise x.

    Args:
        part: a, how much of a new reading goes into what is felt.
    """
    left = math.sqrt(part / (2.0 - part))
    return FtNoise(left * noise.force_n, left * noise.torque_nm)


@final
class WristSensor:
    """What one arm feels at its wrist during one replay."""

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
        self._part = low_pass_part(bandwidth_hz)
        self._offset = OFFSETS * self._sigma * rng.standard_normal(6)
        self._zero: Array = np.zeros(6)
        self._T_tip_sensor = _sensor_frame(scene.kinematics, scene.arm)
        self._sum: Array = np.zeros(6)
        self._summed_s = 0.0
        self._clock_s = 0.0
        self._felt: Array | None = None
        self._readings: list[Array] | None = None
        self._hand = hand_load(scene.kinematics, scene.arm, scene.arm.opening_m)
        self._held: tuple[Load, ...] = ()
        self._weights: Array = np.zeros((6, 3))
        self.hold()

    @property
    def sigma(self) -> tuple[float, float]:
        """Standard deviation of what is felt behind the low pass, per axis, [N] and [Nm]."""
        return felt_noise(FtNoise(*self._sigma[[0, 3]].tolist()), self._part)

    def hold(self, *parts: Load) -> None:
        """Say what is in the hand, or nothing, as it is believed (`part_loads`); its weight is not felt then."""
        self._held = parts
        T = pose.inverse(self._T_tip_sensor)
        loads = (self._hand, *parts)
        mass = sum(load.mass_kg for load in loads)
        moment = sum((load.mass_kg * (T[:3, :3] @ load.center + T[:3, 3]) for load in loads), np.zeros(3))
        # The arm carries each weight, m g upwards at its centre c: a force m g up, and a torque m c x g up.
        self._weights = _GRAVITY * np.vstack([mass * np.eye(3), pose.hat(moment)])

    def begin(self, hand: Load) -> None:
        """Feel anew, after time in which nothing was read: the first reading is taken as it is."""
        self._hand = hand
        self.hold(*self._held)
        self._sum = np.zeros(6)
        self._summed_s = self._clock_s = 0.0
        self._felt = None

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
        self._felt = reading if self._felt is None else self._felt + self._part * (reading - self._felt)
        if self._readings is not None:
            self._readings.append(reading)
        return True

    def at(self, sensordata: Array, encoders: Callable[[], Array], rng: np.random.Generator) -> "WristSensor":
        """The same sensor, as it is zeroed, in another simulation of its robot and with other noise; begin anew."""
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
        if self._felt is None:
            return np.zeros(6)
        T = self._sensor()
        out = (self._weights @ T[2, :3] + self._zero - self._felt).reshape(2, 3) @ T[:3, :3].T
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
        return -float(self.wrench(np.zeros(3))[:3] @ guard.way) > guard.newton

    def _sensor(self) -> Array:
        """Where the sensor is by the encoders, (4, 4), world."""
        return np.asarray(self._kinematics.forward(self._encoders()) @ self._T_tip_sensor)


def _sensor_frame(kinematics: Kinematics, arm: Arm) -> Array:
    """The mount of the hand in the frame of the tip, (4, 4): both are on the same rigid body."""
    model = kinematics.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    tip = model.site(arm.tip).id
    T_tip = frame(data.site_xmat[tip], data.site_xpos[tip])
    return np.asarray(pose.inverse(T_tip) @ body_frame(data, model.body(arm.mount).id))
