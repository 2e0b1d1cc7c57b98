"""Lay out the table of a generated assembly: the range of the site, and start poses within reach; lengths in mm."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array
from apo_bench.scenario.generated.assembly import GeneratedAssembly
from apo_bench.scenario.parts.making import Body

_ARM = np.array([-420.0, 0.0])
"""Base of the default arm, (x, y)."""
_REACH = (285.0, 640.0)
"""Least and largest distance from the base at which the arm reaches the table."""
_LEAST_ASIDE = 110.0
"""Least |y| of a start position, to keep the space between arm and site free for the links."""
_CENTER = 95.0
"""x of the centre of the site."""
_YAW_DEG = 20.0
"""Largest rotation of the site, in either direction."""
_SPREAD_X = (5.0, 30.0)
"""Least and largest half width of the range of the site along x."""
_SPREAD_Y = (5.0, 40.0)
"""The same along y."""
_ROOM = np.array([36.0, 58.0])
"""Least distance between start positions along x and y; larger along y, in which the fingers close."""
_BESIDE = 45.0
"""Least distance between start positions and the area that the site may cover."""
_GRID = 6.0
"""Distance between candidate start positions."""


class TableLayout(NamedTuple):
    """The layout of a table."""

    starts: Mapping[str, tuple[float, float, float]]
    """Movable part -> start position of its frame."""
    center: tuple[float, float]
    """Centre of the site."""
    spread: tuple[float, float]
    """Half widths of the range of the site."""
    yaw_deg: float
    """Largest rotation of the site, in either direction."""


def lay_out_table(made: GeneratedAssembly, rng: np.random.Generator) -> TableLayout:
    """Draw the start positions of all movable parts, the longest along x first.

    Raises:
        RuntimeError: There is no room for all parts.
    """
    # Radius of the disc that the fixed parts cover at any rotation.
    corners = np.concatenate([_bounding_rectangle(made.parts[part]) + at[:2] for part, at in made.fixed.items()])
    reach = float(np.hypot(*np.abs(corners).max(axis=0)))
    spread = (float(np.clip(150.0 - reach, *_SPREAD_X)), float(np.clip(150.0 - reach, *_SPREAD_Y)))
    yaw = np.radians(_YAW_DEG)
    half = np.abs(corners).max(axis=0)
    kept = spread + np.array([[np.cos(yaw), np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]) @ half + _BESIDE
    # Occupied rectangles as lowest and highest corners; the first is the area of the site, with its margin.
    taken = [(np.array([_CENTER, 0.0]) - kept, np.array([_CENTER, 0.0]) + kept)]
    starts = dict[str, tuple[float, float, float]]()
    movable = [part for part in made.parts if part not in made.fixed]
    for part in sorted(
        rng.permutation(movable).tolist(),
        key=lambda part: -float(np.ptp(_bounding_rectangle(made.parts[part]), axis=0)[0]),
    ):
        low, high = _bounding_rectangle(made.parts[part])
        size = (high - low) / 2
        places = _list_grid_places() + rng.uniform(-_GRID / 2, _GRID / 2, 2)
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


def _list_grid_places() -> Array:
    """Candidate start positions (k, 2) within reach on both sides of the site, the nearest to it first."""
    x, y = np.meshgrid(np.arange(-130.0, 190.0, _GRID), np.arange(-400.0, 401.0, _GRID), indexing="ij")
    places = np.column_stack([x.ravel(), y.ravel()])
    far = np.hypot(*(places - _ARM).T)
    places = places[(far > _REACH[0]) & (far < _REACH[1]) & (np.abs(places[:, 1]) > _LEAST_ASIDE)]
    return places[np.argsort(np.hypot(places[:, 0] - 20.0, places[:, 1]), kind="stable")]


def _bounding_rectangle(body: Body) -> Array:
    """Lowest and highest corner (x, y) of a body in the top view, as rows, (2, 2)."""
    corners = np.concatenate([piece.corners for piece in body.pieces])[:, :2]
    return np.asarray(1e3 * np.array([corners.min(axis=0), corners.max(axis=0)]))
