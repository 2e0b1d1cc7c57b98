"""Lay out a table: the site, and start poses in reach of the arm; lengths in mm."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array
from apo_bench.scenario.generated.assembly import GeneratedAssembly
from apo_bench.scenario.parts.making import Body

_ARM = np.array([-420.0, 0.0])
"""Where the arm that comes with the benchmark stands; it reaches the table between two distances."""
_REACH = (285.0, 640.0)
_LEAST_ASIDE = 110.0
"""No part starts between the arm and the site, where its links pass."""
_CENTER = 95.0
_YAW_DEG = 20.0
_SPREAD_X = (5.0, 30.0)
_SPREAD_Y = (5.0, 40.0)
_ROOM = np.array([36.0, 58.0])
"""Between parts at their starts: fingers close across y."""
_BESIDE = 45.0
"""Between parts at their starts and wherever the site may be."""
_GRID = 6.0


class TableLayout(NamedTuple):
    """How the table is laid."""

    starts: Mapping[str, tuple[float, float, float]]
    center: tuple[float, float]
    spread: tuple[float, float]
    yaw_deg: float


def lay(made: GeneratedAssembly, rng: np.random.Generator) -> TableLayout:
    """Draw where parts start.

    Raises:
        RuntimeError: There is no room for all of them.
    """
    # The disc around the assembly that its fixed parts fill, wherever they are turned.
    corners = np.concatenate([_box(made.parts[part]) + at[:2] for part, at in made.fixed.items()])
    reach = float(np.hypot(*np.abs(corners).max(axis=0)))
    spread = (float(np.clip(150.0 - reach, *_SPREAD_X)), float(np.clip(150.0 - reach, *_SPREAD_Y)))
    yaw = np.radians(_YAW_DEG)
    half = np.abs(corners).max(axis=0)
    kept = spread + np.array([[np.cos(yaw), np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]) @ half + _BESIDE
    taken = [(np.array([_CENTER, 0.0]) - kept, np.array([_CENTER, 0.0]) + kept)]
    starts = dict[str, tuple[float, float, float]]()
    movable = [part for part in made.parts if part not in made.fixed]
    for part in sorted(
        rng.permutation(movable).tolist(), key=lambda part: -float(np.ptp(_box(made.parts[part]), axis=0)[0])
    ):
        low, high = _box(made.parts[part])
        size = (high - low) / 2
        places = _grid() + rng.uniform(-_GRID / 2, _GRID / 2, 2)
        free = np.ones(len(places), dtype=np.bool_)
        for a, b in taken:
            room = _ROOM if a is not taken[0][0] else 0.0
            free &= ((places - size > b + room) | (a > places + size + room)).any(axis=1)
        if not free.any():
            raise RuntimeError(f"no room for {part}")
        at = np.round(places[int(np.argmax(free))], 1)
        taken.append((at - size, at + size))
        starts[part] = (*(at - (low + high) / 2).round(3).tolist(), 0.0)
    return TableLayout(starts, (_CENTER, 0.0), spread, _YAW_DEG)


def _grid() -> Array:
    """Places in reach on both sides of the site, (k, 2), the nearest first."""
    x, y = np.meshgrid(np.arange(-130.0, 190.0, _GRID), np.arange(-400.0, 401.0, _GRID), indexing="ij")
    places = np.column_stack([x.ravel(), y.ravel()])
    far = np.hypot(*(places - _ARM).T)
    places = places[(far > _REACH[0]) & (far < _REACH[1]) & (np.abs(places[:, 1]) > _LEAST_ASIDE)]
    return places[np.argsort(np.hypot(places[:, 0] - 20.0, places[:, 1]), kind="stable")]


def _box(body: Body) -> Array:
    """Lowest and highest corner of a body over the table, (2, 2)."""
    corners = np.concatenate([piece.corners for piece in body.pieces])[:, :2]
    return np.asarray(1e3 * np.array([corners.min(axis=0), corners.max(axis=0)]))
