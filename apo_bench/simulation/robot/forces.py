"""The contact forces that a robot reads."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import Array
from apo_bench.simulation.scene import World

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
        """The filtered force, (3,), [N], after one that lasted so long, at most the time constant."""
        part = seconds / self._time_constant_s
        x, y, z = self.force
        fx, fy, fz = force
        self.force = [x + (fx - x) * part, y + (fy - y) * part, z + (fz - z) * part]
        return self.force


class Guard(NamedTuple):
    """Stop when the held part is pushed back along `way` by more than `newton`."""

    direction: Array
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
        self.sensors = contacts
        """The contact sensors as the last step left them."""
        self._on_arm_flat = contacts[3 * len(work.free) :]
        self._on_arm = self._on_arm_flat.reshape(-1, 3)
        self._net_of_sensors = np.zeros((3, len(contacts)))
        self._handled: int | None = None
        self.held: tuple[str, ...] = ()
        self.wrist = LowPass(WRIST_S)
        self.peak_n = 0.0
        """The largest that the sensor at the wrist has shown."""

    def hold(self, *parts: str) -> None:
        """Set which parts are in the hand: the held one and what it carries, or none."""
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
        """Set which part the fingers may touch."""
        self._handled = None if part is None else self._free.index(part)

    def net(self) -> list[float]:
        """The net force of everything but the gripper on what is in the hand, (3,) world, [N]."""
        net: list[float] = np.dot(self._net_of_sensors, self.sensors).tolist()
        return net

    def push(self, guard: Guard) -> Array:
        """What the sensors are multiplied by for the force against a guard."""
        return np.asarray(-guard.direction @ self._net_of_sensors)

    def take(self, sensors: Array, step_s: float) -> None:
        """Let the sensor at the wrist take up the sensors of some steps, (k, sensors)."""
        for force in (sensors @ self._net_of_sensors.T).tolist():
            self.peak_n = max(self.peak_n, math.hypot(*self.wrist(force, step_s)))

    def load(self) -> float:
        """The weight on the gripper, [N]: of the held part and of what really hangs on it."""
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
