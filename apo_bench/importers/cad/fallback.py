"""Import a solid with exact pieces, else with coarser ones, else as its convex hull."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull
from shapely.errors import ShapelyError

from apo_bench.errors import InputError
from apo_bench.geometry import Array, Hull, Solid, measure_depth_inside
from apo_bench.importers.cad.near_points import sample_surface_points
from apo_bench.importers.cad.part_import import ImportedPart, import_solid
from apo_bench.importers.cad.pieces.convex_cutting import CutSolid, cut_solid
from apo_bench.importers.cad.pieces.corners import list_hull_corners
from apo_bench.importers.cad.solids import RawSolid

_STEP_MM = 1.0  # distance of the sampled points of the surface
_MOST_POINTS = 4000
_FAULTS = (InputError, ValueError, RuntimeError, ShapelyError)
"""What the import of a solid with a bad surface may raise, by this package or by the libraries that cut it."""


def import_solid_anyway(
    raw: RawSolid, name: str, folder: Path, source: str, density: float = 1000.0, others: Array | None = None
) -> ImportedPart:
    """Import a solid as `import_solid` does; if its exact pieces make no part, with coarser ones.

    The repairs of the part then state by how much its pieces differ from the solid.

    Raises:
        InputError: Not even the convex hull makes a part: it is too thin, too light or too heavy.
    """
    try:
        return import_solid(raw, name, folder, source, density, others)
    except _FAULTS as error:
        failed: Exception = error
    for cut, words in _list_cuts(raw, others):
        try:
            part = import_solid(raw, name, folder, source, density, others, cut())
        except _FAULTS as error:
            failed = error
            continue
        off = measure_deviation(raw, part.solid)
        repair = f"{words}, {off:.2g} mm off at most; `scenario check` shows whether that matters"
        return replace(part, raw=replace(part.raw, repairs=(*part.raw.repairs, repair)))
    if isinstance(failed, InputError):
        raise failed
    raise InputError(f"{source}: the solid makes no part ({failed}); save it again, or draw it simpler.") from failed


def _list_cuts(raw: RawSolid, others: Array | None) -> Iterator[tuple[Callable[[], CutSolid], str]]:
    """Yield the ways to cut a solid that cannot be cut exactly, the finest first, with the words for a report."""
    yield lambda: cut_solid(raw, others, coarse=True), "a coarser shape stands for the solid in collisions"
    yield lambda: _cut_as_hull(raw), "its convex hull stands for the solid in collisions"


def _cut_as_hull(raw: RawSolid) -> CutSolid:
    """Return the convex hull of a solid as its only piece."""
    flats = np.array([(*r.direction, r.direction @ r.point) for r in raw.regions if r.kind == "plane"]).reshape(-1, 4)
    corners = raw.mesh.corners[ConvexHull(raw.mesh.corners).vertices]
    return CutSolid((Hull("", 1e-3 * list_hull_corners(corners, flats)),), 1, coarse=True)


def measure_deviation(raw: RawSolid, solid: Solid) -> float:
    """Return how far the surface of a solid lies inside its pieces, or outside of all of them, at most, [mm]."""
    points = sample_surface_points(raw.mesh, _STEP_MM)
    points = 1e-3 * points[:: max(1, len(points) // _MOST_POINTS)]
    depth = np.array([measure_depth_inside(piece, points) for piece in solid.pieces])
    return 1e3 * float(np.abs(depth.max(axis=0)).max())
