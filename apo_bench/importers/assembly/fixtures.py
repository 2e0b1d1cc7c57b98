"""Make fixtures for parts that do not stand in their assembly orientation: supporting columns, and walls if needed."""

from collections.abc import Sequence
from itertools import groupby, pairwise
from xml.sax.saxutils import quoteattr

import numpy as np

from apo_bench.geometry import Array, Box, Solid, collect_corners, intersect_rays, measure_intrusion_depths
from apo_bench.importers.assembly.staging import is_carried
from apo_bench.scenario.parts.limits import THINNEST_M

FLOOR_M = 0.002
"""Height of the part's lowest point above the table."""
_CELL_M = 0.004  # width of a column
_MOST = 9  # columns along x, and along y
_BESIDE_M = 0.0025
"""The columns end this far inside the bounding box of the part, to leave room for the fingers."""
_RAYS = 3
"""Rays along x, and along y, that measure the height of one column."""
_INSET_M = 1e-6  # the rays start this far inside the cell's edges
_BELOW_M = 1e-5
"""Gap between part and columns at the start; the part settles onto them."""
_WALL_M = 0.005  # thickness of a wall
_PLAY_M = 0.00015  # gap between a wall and the bounding box of the part
# Signs of the upper four corners of a box; their height does not matter.
_CORNERS = np.array([[-1.0, -1, 0], [-1, 1, 0], [1, -1, 0], [1, 1, 0]])
_WALL_SHARE = 0.4  # height of a wall, as a share of the height of the part
_HIGHEST_M = 0.02  # largest height of a wall


def make_fixture(name: str, solid: Solid, R: Array) -> Solid:
    """Return the fixture for a part: axis-aligned boxes that carry the part in a given orientation.

    Args:
        R: (3, 3), orientation of the part in the world.

    Returns:
        The fixture. Its frame is on the table, right below the frame of the part. The part stands `FLOOR_M` higher
        in the fixture than it would on the table.
    """
    corners = collect_corners(solid.pieces)[0] @ R.T
    low, high = corners.min(axis=0), corners.max(axis=0)
    rise = FLOOR_M - low[2]  # height of the part's frame above the fixture's
    T = np.eye(4)
    T[:3] = np.column_stack([R, [0.0, 0.0, rise]])
    inset = np.minimum(_BESIDE_M, (high - low)[:2] / 4)
    fitted = [_fit_height(each, solid, T) for each in _make_columns(solid, R, rise, low[:2] + inset, high[:2] - inset)]
    feet = np.concatenate([np.zeros((0, 2)), *((b.center + _CORNERS * b.half)[:, :2] for b in fitted if b.half[2] > 0)])
    middle = R @ solid.centroid
    # The columns alone do not keep the part from toppling.
    walls = [] if is_carried(feet, middle, float(middle[2] - low[2])) else _make_walls(low, high)
    beside = _WALL_M if walls else -inset  # the plate reaches under walls, or ends at the columns
    plate = _make_box((*(low[:2] - beside), 0.0), (*(high[:2] + beside), FLOOR_M - _BELOW_M))
    columns = [box for box in fitted if box.half[2] > plate.half[2] + _INSET_M and box.half.min() > THINNEST_M]
    boxes = tuple(Box(f"p{i}", b.center, b.half) for i, b in enumerate((plate, *columns, *walls), start=1))
    # Fixed, so its mass does not matter.
    return Solid(name=name, faces={}, pieces=boxes, centroid=np.zeros(3), volume=1.0)


def _make_columns(solid: Solid, R: Array, rise: float, low: Array, high: Array) -> list[Box]:
    """Return a column below each cell of a grid, as high as the lowest point of the part above the cell.

    Args:
        R: (3, 3), orientation of the part.
        rise: Height of the part's frame above the table, [m].
        low, high: (2,), the rectangle of the grid in x and y, [m].

    Returns:
        The columns; neighbours of equal height in a row along x are one box. Cells with no part above have none.
    """
    cells = np.clip(np.ceil((high - low) / _CELL_M), 2, _MOST).astype(int)
    x, y = (np.linspace(low[i], high[i], 1 + cells[i]) for i in (0, 1))
    boxes = []
    for y0, y1 in pairwise(y):
        tops = [_measure_lowest_point(solid, R, (x0, y0), (x1, y1)) + rise - _BELOW_M for x0, x1 in pairwise(x)]
        for top, same in groupby(range(len(tops)), key=lambda i: round(tops[i], 6)):
            run = list(same)
            if np.isfinite(top):  # some of the part is above these cells
                boxes.append(_make_box((x[run[0]], y0, 0.0), (x[run[-1] + 1], y1, top)))
    return boxes


def _measure_lowest_point(solid: Solid, R: Array, begin: tuple[float, float], end: tuple[float, float]) -> float:
    """Return the height over its frame of the lowest point of a turned solid above a rectangle, [m]; inf if none.

    Args:
        R: (3, 3), orientation of the solid.
        begin, end: Lowest and highest x and y of the rectangle, relative to the frame of the solid, [m].
    """
    sides = [np.linspace(a + _INSET_M, b - _INSET_M, _RAYS) for a, b in zip(begin, end, strict=True)]
    grid = np.stack([*(each.ravel() for each in np.meshgrid(*sides)), np.zeros(_RAYS**2)], axis=1)
    return min(float(intersect_rays(piece.planes, grid @ R, R[2])[0].min()) for piece in solid.pieces)


def _fit_height(box: Box, solid: Solid, T: Array) -> Box:
    """Lower a column until it no longer intersects the solid at T; its height is 0 if three tries do not suffice."""
    low = (box.center - box.half)[:2]
    high = (box.center + box.half)[:2]
    for _ in range(3):
        depth = float(measure_intrusion_depths((box,), np.eye(3), np.zeros((1, 3)), solid.pieces, T, 0.0)[0])
        if depth <= 0.0:
            return box
        box = _make_box((*low, 0.0), (*high, 2 * max(0.0, box.half[2] - depth)))
    return _make_box((*low, 0.0), (*high, 0.0))


def _make_walls(low: Array, high: Array) -> list[Box]:
    """Return four walls around the bounding box from `low` to `high`, (3,) each, [m]; they stand on the table."""
    top = FLOOR_M + min(_WALL_SHARE * (high[2] - low[2]), _HIGHEST_M)
    middle, reach = (low + high)[:2] / 2, (high - low)[:2] / 2 + _PLAY_M
    boxes = []
    for axis, sign in ((0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)):
        half = np.array([*reach, top / 2])
        half[axis] = _WALL_M / 2
        center = np.array([*middle, top / 2])
        center[axis] += sign * (reach[axis] + _WALL_M / 2)
        boxes.append(Box("", center, half))
    return boxes


def _make_box(low: Sequence[float], high: Sequence[float]) -> Box:
    """Return the unnamed box between two opposite corners, lowest and highest coordinates."""
    return Box("", np.add(low, high) / 2, np.subtract(high, low) / 2)


def fixture_xml(fixture: Solid) -> str:
    """Return the MJCF text of the part file of a fixture."""
    geoms = [
        f'      <geom name="{b.name}" pos="{_format_numbers(b.center)}" size="{_format_numbers(b.half)}"/>'
        for b in fixture.pieces
    ]
    return "\n".join(
        [
            f"<mujoco model={quoteattr(fixture.name)}>",
            '  <default><geom type="box" density="600" friction="0.3 0.005 0.0001" rgba="0.55 0.6 0.65 1"/></default>',
            "  <worldbody>",
            f"    <body name={quoteattr(fixture.name)}>",
            *geoms,
            "    </body>",
            "  </worldbody>",
            "</mujoco>\n",
        ]
    )


def _format_numbers(values: Array) -> str:
    return " ".join(f"{float(x):.9g}" for x in values)
