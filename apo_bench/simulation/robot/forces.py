"""The contact force on the held part and on the arm, read from MuJoCo's contact sensors."""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from apo_bench.geometry import Array
from apo_bench.simulation.scene import World

WRIST_S = 0.02
"""Time constant of the force filter (8 Hz).

When hard parts touch, halving the physics step nearly doubles the force of a single step, but its impulse stays. The
filtered force hardly depends on the step. Real force sensors have filters of 5 to 70 Hz for the same reason.
"""
_COLLISION_N = 20.0
"""Contact force on the arm above which it makes a protective stop, unless it handles the part."""


class LowPass:
    """A first-order low pass of a force, dy/dt = (x - y) / time constant."""

    def __init__(self, time_constant_s: float) -> None:
        self._time_constant_s = time_constant_s
        self.force = [0.0, 0.0, 0.0]

    def __call__(self, force: Sequence[float], seconds: float) -> list[float]:
        """Filter a force that acted for some time; return the filtered force, (3,), [N].

        It computes with plain floats, since small arrays are slow.

        Args:
            force: Mean force during this time, (3,), [N].
            seconds: Duration, at most the time constant, or the filter overshoots.
        """
        part = seconds / self._time_constant_s
        x, y, z = self.force
        fx, fy, fz = force
        self.force = [x + (fx - x) * part, y + (fy - y) * part, z + (fz - z) * part]
        return self.force

    def filter_steps(self, forces: Array, step_s: float) -> Array:
        """Filter the forces of several steps; return the filtered force after each, (k, 3), [N].

        Args:
            forces: Mean force during each step, (k, 3), [N].
            step_s: Length of a step, at most the time constant.
        """
        decay, weights = low_pass_weights(len(forces), step_s / self._time_constant_s)
        filtered = decay * self.force + weights @ forces
        self.force = filtered[-1].tolist()
        return np.asarray(filtered)


@lru_cache(maxsize=256)
def low_pass_weights(k: int, part: float) -> tuple[Array, Array]:
    """Return the weights of a low pass over k steps: of its state before, (k, 1), and of the forces, (k, k).

    Args:
        part: Length of a step over the time constant.
    """
    kept: Array = np.power(1.0 - part, np.arange(k + 1.0))  # share of a force that is left after so many steps
    steps = np.arange(k)
    return kept[1:, None], np.tril(part * kept[steps[:, None] - steps])


class Guard(NamedTuple):
    """A force limit: the motion stops when the held part is pushed against `direction` by more than `newton`."""

    direction: Array
    """Unit vector of the motion, (3,), world."""
    newton: float
    """Limit of the force, [N]."""


class ForceSensors:
    """The contact sensors of a scene, as the robot reads them.

    Order of `sensordata`, three numbers each, world, [N]: first, for each movable part, the force that it exerts on all
    that it touches. Then, for each movable and each fixed part, the force that it exerts on the arm. The sensors of the
    wrist come last and are not read here.
    """

    def __init__(self, work: World, sensordata: Array) -> None:
        """Take a view of `MjData.sensordata`, so each physics step updates it."""
        self._free = work.free
        self._names = (*work.free, *work.fixed)
        contacts = sensordata[: 3 * (len(work.free) + len(self._names))]
        self.sensors = contacts
        """The contact sensors after the last physics step: a view of `sensordata`."""
        self._on_arm_flat = contacts[3 * len(work.free) :]
        self._on_arm = self._on_arm_flat.reshape(-1, 3)
        self._net_of_sensors = np.zeros((3, len(contacts)))  # contact sensors -> net force on the held parts
        self._handled: int | None = None  # index of the part that the fingers may touch
        self.needed: list[int] = []
        """The sensors that `net` and `push` read, by their number."""
        self.held: tuple[str, ...] = ()
        """The held part, then the parts that it carries."""
        self.wrist = LowPass(WRIST_S)
        """The filtered net force on the held parts."""
        self.peak_n = 0.0
        """The largest magnitude of the filtered force so far, [N]."""

    def hold(self, *parts: str) -> None:
        """Set the parts in the hand: the held one, then those that it carries; none for an empty hand."""
        self.held = parts
        self.wrist = LowPass(WRIST_S)
        # Force on a part = -(its own sensor) - (force of the arm on it), and the latter is -(force of it on the arm).
        # Forces between the parts of a group cancel in the sum over the group.
        self._net_of_sensors = np.zeros_like(self._net_of_sensors)
        own = [*map(self._free.index, parts)]
        on_arm = [len(self._free) + i for i in own]
        self.needed = [*own, *on_arm]
        by_sensor = self._net_of_sensors.reshape(3, -1, 3)
        by_sensor[:, on_arm] += np.eye(3)[:, None]
        by_sensor[:, own] -= np.eye(3)[:, None]

    def handle(self, part: str | None) -> None:
        """Set the part that the fingers may touch without a collision; None: no part."""
        self._handled = None if part is None else self._free.index(part)

    def net(self) -> list[float]:
        """Return the net contact force on the held parts, except that of the gripper, (3,), world, [N]."""
        net: list[float] = np.dot(self._net_of_sensors, self.sensors).tolist()
        return net

    def net_along(self, axes: Array) -> Array:
        """Return the matrix from `sensors` to the net force of `net` along other axes, (3, sensors), [N].

        Args:
            axes: (3, 3), columns, world.
        """
        return np.ascontiguousarray(axes.T @ self._net_of_sensors)

    def external_n(self) -> float:
        """Return the contact force on the held parts, or on the arm with an empty hand, [N]."""
        return math.hypot(*self.net()) if self.held else float(np.linalg.norm(self._on_arm_flat))

    def push(self, guard: Guard) -> Array:
        """Return the weights, (sensors,), whose dot product with `sensors` is the force against a guard, [N]."""
        return np.asarray(-guard.direction @ self._net_of_sensors)

    def take(self, sensors: Array, step_s: float) -> None:
        """Filter the net force of some physics steps and update the peak.

        Args:
            sensors: Contact sensors after each step, (k, sensors).
            step_s: Length of a step, [s].
        """
        x, y, z = self.wrist.filter_steps(sensors @ self._net_of_sensors.T, step_s).T
        self.peak_n = max(self.peak_n, float(np.hypot(np.hypot(x, y), z).max()))

    def take_step(self, step_s: float) -> list[float]:
        """Filter the net force of the last physics step and update the peak; return the net force, (3,), [N].

        Args:
            step_s: Length of the step, [s].
        """
        force = self.net()
        self.peak_n = max(self.peak_n, math.hypot(*self.wrist(force, step_s)))
        return force

    def load(self) -> float:
        """Return the weight on the gripper, [N]: of the held part and of everything that really hangs on it."""
        return -float(self._on_arm[:, 2].sum())  # vertical forces; parts push the arm down

    def find_collision(self) -> str | None:
        """Return the part with which the arm collides harder than `_COLLISION_N`, None if there is none.

        The part that is handled does not count.
        """
        if self._on_arm_flat @ self._on_arm_flat <= _COLLISION_N**2:  # quick test: all forces together are too small
            return None
        squares = (self._on_arm * self._on_arm).sum(axis=1)
        if self._handled is not None:
            squares[self._handled] = 0.0
        hardest = int(squares.argmax())
        return self._names[hardest] if math.sqrt(squares[hardest]) > _COLLISION_N else None

    def memory(self) -> tuple[Any, ...]:
        """Return the state that is kept between steps, for `remember`."""
        return self.held, self._handled, self.wrist.force, self.peak_n

    def remember(self, memory: tuple[Any, ...]) -> None:
        """Restore the state that `memory` returned."""
        held, self._handled, force, self.peak_n = memory
        self.hold(*held)
        self.wrist.force = force
