"""Choose the home of an arm: joint angles over the table from which it reaches most of the table."""

from dataclasses import replace
from itertools import product

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry import Array
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.frames import frame

_AT = (-0.05, 0.0, 0.30)  # position of the tip at home, [m]
_TABLE = [(-0.15, -0.25, 0.03), (-0.15, 0.25, 0.3), (0.2, 0.25, 0.03), (0.2, -0.25, 0.3)]
"""Positions of the tip, [m], that should be in reach."""
_TURNS = (-1.6, 0.0, 1.6)  # yaws of the tip relative to home, [rad], that should be in reach
_WAYS = (0.0, np.pi / 2, np.pi, -np.pi / 2)  # candidate yaws of the tip at home, [rad]
_MOST_PLACES = len(_TABLE) * len(_TURNS)
_NEARER_M = (-0.4, -0.3, -0.2, -0.1)
"""Candidate x of the base, for an arm that reaches at most half of the table from the default base."""
_STANDS_M = (0.0, 0.1, 0.2)  # candidate heights of that base
_TRIES = 40  # random starts of the search
_QUICK_TRIES = 16  # the same for each other position of the base
_WIDEST = 3.0  # [rad]: bound of the joint angles of a start
_SAME_RAD = 0.2  # homes with smaller differences are equal
_TABLE_ROOM_M = 0.02  # least height of the links' centres of mass
_NEAR = 0.4  # share of the joint range from which every other start is drawn
_ENOUGH_RAD = 0.3
"""A larger margin to joint limits does not count; then higher links are preferred."""


def tip_down(at: Array, turn: float = 0.0) -> Array:
    """The pose, (4, 4), of a tip that points down; at turn 0 [rad] its fingers close along x."""
    c = np.cos(turn)
    s = np.sin(turn)
    return frame(np.array([[-c, s, 0.0], [-s, -c, 0.0], [0.0, 0.0, 1.0]]) @ np.diag([1.0, -1.0, -1.0]), at)


def with_home(arm: Arm, base_is_stated: bool) -> Arm:
    """The arm with the home from which the tip reaches most of the table, with the largest margin to joint limits.

    Args:
        base_is_stated: If not, the base of a short arm moves nearer or onto a stand, where it reaches most.

    Raises:
        InputError: The tip does not reach its home position at all.
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
    """Search for the best home by random starts.

    Returns:
        (number of positions on the table in reach, home angles [rad]), or None if there is no home.
    """
    kinematics = Kinematics(arm, posture=False)
    rng = np.random.default_rng(0)
    low, high = (np.clip(limit, -_WIDEST, _WIDEST) for limit in kinematics.joint_range)
    homes: list[tuple[Array, float]] = []  # joint angles, yaw
    for i in range(tries):
        start = rng.uniform(low, high)
        near = _NEAR * (i > 0)  # 0 for the first try
        # Even tries start near the middle of the ranges (the first exactly there), odd ones anywhere.
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
    """The worth of a home, compared in order: positions in reach, margin to limits (capped), mean link height."""
    reached, least = room(kinematics, q, way)
    kinematics.forward(q)
    moved = kinematics.model.body_jntnum > 0
    # rounded so that nearly equal margins compare by height
    return reached, round(min(least, _ENOUGH_RAD), 2), float(kinematics.configuration.data.xpos[moved, 2].mean())


def room(kinematics: Kinematics, home: Array, way: float) -> tuple[int, float]:
    """The number of table positions in reach from home, and the least distance of a joint from its limit there, [rad].

    Args:
        way: Yaw of the tip at home, [rad].
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
    """Joint angles of the same pose with every joint within half a turn of zero, if its limits allow."""
    near = (q + np.pi) % (2 * np.pi) - np.pi
    return np.where((near >= low) & (near <= high), near, q)


def _in_table(kinematics: Kinematics, q: Array) -> bool:
    """Whether the centre of mass of a link is in the table."""
    kinematics.forward(q)
    moved = kinematics.model.body_jntnum[1:] > 0
    return bool((kinematics.configuration.data.xipos[1:][moved, 2] < _TABLE_ROOM_M).any())
