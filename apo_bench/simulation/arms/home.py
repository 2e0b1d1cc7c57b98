"""Find the joint angles at which an arm waits over the table with most room."""

from dataclasses import replace
from itertools import product

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry import Array
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.frames import frame

_AT = (-0.05, 0.0, 0.30)  # place of the waiting tip, [m]
_TABLE = [(-0.15, -0.25, 0.03), (-0.15, 0.25, 0.3), (0.2, 0.25, 0.03), (0.2, -0.25, 0.3)]
"""Places of the tip, [m], at which there should be room."""
_TURNS = (-1.6, 0.0, 1.6)  # turns from the way it waits, [rad], at which there should be room
_WAYS = (0.0, np.pi / 2, np.pi, -np.pi / 2)  # ways it may wait, [rad]
_MOST_PLACES = len(_TABLE) * len(_TURNS)
_NEARER_M = (-0.4, -0.3, -0.2, -0.1)
"""Places of a base behind the middle of the table, of an arm that reaches at most half of it."""
_STANDS_M = (0.0, 0.1, 0.2)  # heights of such a base
_TRIES = 40  # random starts of the search
_QUICK_TRIES = 16  # as `_TRIES`, for each other place of the base
_WIDEST = 3.0  # [rad]: no start is farther from zero
_SAME_RAD = 0.2  # homes that differ by less are one
_TABLE_ROOM_M = 0.02  # links stay so far above the table
_NEAR = 0.4  # every other start is so near to the middle of the ranges
_ENOUGH_RAD = 0.3
"""More room to a limit than this counts less than links that are high above the table."""


def tip_down(at: Array, turn: float = 0.0) -> Array:
    """A tip that looks down, (4, 4); at turn 0 its fingers close along x."""
    c = np.cos(turn)
    s = np.sin(turn)
    return frame(np.array([[-c, s, 0.0], [-s, -c, 0.0], [0.0, 0.0, 1.0]]) @ np.diag([1.0, -1.0, -1.0]), at)


def with_home(arm: Arm, base_is_stated: bool) -> Arm:
    """The arm with the joint angles at which it waits: from there the tip reaches most of the table with most room.

    Args:
        base_is_stated: Else the base of an arm that is short stands nearer, or on a stand, where most is reached.

    Raises:
        InputError: The arm does not reach over the table at all.
    """
    best = _home(arm, _TRIES)
    if not base_is_stated and (best is None or best[0] <= _MOST_PLACES / 2):
        for z, x in product(_STANDS_M, _NEARER_M):
            nearer = replace(arm, base=(x, 0.0, z))
            found = _home(nearer, _QUICK_TRIES)
            if found is not None and (best is None or found[0] > best[0]):
                best = found
                arm = nearer
    if best is None:
        at = ", ".join(f"{1e3 * x:g}" for x in _AT)
        raise InputError(
            f"{arm.mjcf}: the tip does not reach ({at}) mm looking down; move the 'base', which stands at "
            f"({', '.join(f'{1e3 * x:g}' for x in arm.base)}) mm."
        )
    return replace(arm, home=best[1])


def _home(arm: Arm, tries: int) -> tuple[int, Array] | None:
    """How many places on the table are reached from the best home, and that, [rad]; None where there is no home."""
    kinematics = Kinematics(arm, posture=False)
    rng = np.random.default_rng(0)
    low, high = (np.clip(limit, -_WIDEST, _WIDEST) for limit in kinematics.joint_range)
    homes: list[tuple[Array, float]] = []
    for i in range(tries):
        start = rng.uniform(low, high)
        near = _NEAR * (i > 0)
        start = start if i % 2 else (low + high) / 2 + near * (start - (low + high) / 2)
        way = _WAYS[i // 2 % len(_WAYS)]
        q = kinematics.inverse(tip_down(np.array(_AT), way), start, 25)
        if q is None:
            continue
        q = _unwind(q, *kinematics.joint_range)
        if any(np.abs(q - other).max() < _SAME_RAD for other, _ in homes) or _in_table(kinematics, q):
            continue
        homes.append((q, way))
    worths = [(_worth(kinematics, *each), each[0]) for each in homes]
    worth, home = max(worths, key=lambda each: each[0], default=((0, 0.0, 0.0), None))
    return None if home is None else (worth[0], home)


def _worth(kinematics: Kinematics, q: Array, way: float) -> tuple[int, float, float]:
    """Places reached, room to the limits as far as it is needed, height of the joints."""
    reached, least = room(kinematics, q, way)
    kinematics.forward(q)
    moved = kinematics.model.body_jntnum > 0
    return reached, round(min(least, _ENOUGH_RAD), 2), float(kinematics.configuration.data.xpos[moved, 2].mean())


def room(kinematics: Kinematics, home: Array, way: float) -> tuple[int, float]:
    """How many places on the table are reached from home, and the least distance of a joint from its limit, [rad].

    Args:
        way: How the tip is turned there, [rad].
    """
    kinematics.keep_near(home)
    reached = 0
    least = np.inf
    for turn in _TURNS:
        for at in _TABLE:
            q = kinematics.inverse(tip_down(np.array(at), way + turn), home, 25)
            if q is not None:
                reached += 1
                least = min(least, float(kinematics.limit_margins(q).min()))
    return reached, least


def _unwind(q: Array, low: Array, high: Array) -> Array:
    """The same place with every joint less than half a turn from zero, where its limits let it be."""
    near = (q + np.pi) % (2 * np.pi) - np.pi
    return np.where((near >= low) & (near <= high), near, q)


def _in_table(kinematics: Kinematics, q: Array) -> bool:
    """Whether the centre of mass of a link lies in the table."""
    kinematics.forward(q)
    moved = kinematics.model.body_jntnum[1:] > 0
    return bool((kinematics.configuration.data.xipos[1:][moved, 2] < _TABLE_ROOM_M).any())
