"""The exact union of boxes as a solid with flat faces.

A mesh union rounds, and leaves stray corners and fins where boxes share planes. Here the planes of all sides form a
grid whose cells are full or empty, and faces lie between full and empty cells.
"""

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array, Box, list_polygons, list_rings, straighten

_SAME_PLANE_M = 1e-9
"""Sides of boxes this near to each other lie in one plane."""
SIDES = ("px", "nx", "py", "ny", "pz", "nz")
"""Outward directions of faces, in the order of faces in a solid; also the stems of automatic names."""


class UnnamedFace(NamedTuple):
    """A face of the union, before it has a name."""

    side: int
    """Index into `SIDES`."""
    height: float
    """Coordinate of its plane along its axis, [m]."""
    shape: Any
    """A shapely polygon in the two coordinates that follow the axis cyclically, [m]."""

    @property
    def axis(self) -> int:
        """Index of the axis of its normal, 0 to 2."""
        return self.side // 2

    @property
    def sign(self) -> int:
        """1 if it looks along the axis, -1 if against it."""
        return 1 - 2 * (self.side % 2)

    def flat(self, points: Array) -> Array:
        """The coordinates (k, 2) of points (k, 3) in its plane."""
        return points[:, [(self.axis + 1) % 3, (self.axis + 2) % 3]]

    def rings(self) -> tuple[Array, ...]:
        """Its outline, counter-clockwise as seen from outside, then its holes, clockwise; (k, 3) each, [m]."""
        return tuple(map(self._lift_ring, list_rings(self.shape, self.sign)))

    def _lift_ring(self, ring: Array) -> Array:
        """A ring in its plane as points (k, 3), beginning with the lowest corner."""
        flat = straighten(ring)
        flat = np.roll(flat, -np.lexsort(flat.T[::-1])[0], axis=0)
        out = np.empty((len(flat), 3))
        out[:, self.axis] = self.height
        out[:, (self.axis + 1) % 3], out[:, (self.axis + 2) % 3] = flat.T
        return out


class Union(NamedTuple):
    """The union of boxes."""

    surfaces: tuple[UnnamedFace, ...]
    """In the order of `SIDES`, then by height, then by lowest corner."""
    centroid: Array
    """(3,), [m]."""
    volume: float
    """[m^3]."""
    pieces: int
    """Number of separate solids; solids that share only an edge or a corner are separate."""


def unite(boxes: Sequence[Box], most: int | None = None) -> Union:
    """Compute the union of boxes; all its coordinates are those of sides of boxes.

    Args:
        most: Largest number of surfaces to compute; None: all.
    """
    from scipy.ndimage import label

    grid = [_list_side_coordinates(boxes, axis) for axis in range(3)]
    full = _mark_full_cells(boxes, grid)
    volumes = np.einsum("i,j,k,ijk->ijk", *(np.diff(planes) for planes in grid), full)
    volume = float(volumes.sum())
    middles = [(planes[1:] + planes[:-1]) / 2 for planes in grid]
    centroid = [np.moveaxis(volumes, axis, 0).sum(axis=(1, 2)) @ middles[axis] / volume for axis in range(3)]
    surfaces = sorted(islice(_list_surfaces(full, grid), most), key=lambda s: (s.side, s.height, s.shape.bounds))
    return Union(tuple(surfaces), np.array(centroid), volume, int(label(full)[1]))


def _list_side_coordinates(boxes: Sequence[Box], axis: int) -> Array:
    """The coordinates of all sides along an axis, ascending, each once, [m]."""
    sides = np.sort([box.center[axis] + sign * box.half[axis] for box in boxes for sign in (-1, 1)])
    return np.round(sides[np.diff(sides, prepend=-np.inf) > _SAME_PLANE_M], 12)


def _mark_full_cells(boxes: Sequence[Box], grid: Sequence[Array]) -> NDArray[np.bool_]:
    """(cells along x, y, z), True for each cell of the grid that lies in a box."""
    full = np.zeros([len(planes) - 1 for planes in grid], dtype=np.bool_)
    for box in boxes:
        low = box.center - box.half
        high = box.center + box.half
        span = [
            slice(int(np.abs(p - a).argmin()), int(np.abs(p - b).argmin()))
            for p, a, b in zip(grid, low, high, strict=True)
        ]
        full[tuple(span)] = True
    return full


def _find_runs(bare: NDArray[np.bool_]) -> tuple[NDArray[np.intp], ...]:
    """Find the runs of True in the rows of a mask: row, first column, column after the last one, (n,) each."""
    # A run begins where the padded row steps up, and ends where it steps down.
    ends = np.diff(np.pad(bare, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    return *np.nonzero(ends == 1), np.nonzero(ends == -1)[1]


def _list_surfaces(full: NDArray[np.bool_], grid: Sequence[Array]) -> Iterator[UnnamedFace]:
    """Yield every face: rectangles between full and empty cells, per plane, joined where they share an edge."""
    import shapely

    for side in range(len(SIDES)):
        axis = side // 2
        forward = side % 2 == 0
        u = grid[(axis + 1) % 3]
        v = grid[(axis + 2) % 3]
        layers = np.moveaxis(full, [axis, (axis + 1) % 3, (axis + 2) % 3], [0, 1, 2])
        for k, layer in enumerate(layers):
            beyond = k + 1 if forward else k - 1
            bare = layer & ~layers[beyond] if 0 <= beyond < len(layers) else layer
            row, begin, end = _find_runs(bare)
            for piece in list_polygons(shapely.unary_union(shapely.box(u[row], v[begin], u[row + 1], v[end]))):
                yield UnnamedFace(side, float(grid[axis][k + forward]), piece)
