"""What is known of a face that was found: planes with their outward normals, walls with their ends, [mm]."""

from typing import Any

import numpy as np

from apo_bench.cad.faces.facets import FLAT
from apo_bench.cad.faces.fitting import Round
from apo_bench.cad.raw_solid import Mesh, Region
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.round_face import WHOLE_TURN

ON_WALL = 1e-5
"""Of the size of a part: corners of a round face are this near to it."""
_SNAP_RAD = 2e-6


def fitted_plane(mesh: Mesh, triangles: Any) -> Region:
    """The plane nearest to triangles that lie in one."""
    n = mesh.across[triangles].sum(axis=0)
    n = _snapped(n / np.linalg.norm(n))
    middle = mesh.corners[mesh.triangles[triangles]].mean(axis=1)
    weight = np.linalg.norm(mesh.across[triangles], axis=1)
    return plane_region(mesh, triangles, n, float(weight @ (middle @ n) / weight.sum()) * n)


def plane_region(mesh: Mesh, triangles: Any, normal: Array, point: Array) -> Region:
    """Triangles on the plane through a point."""
    n = _snapped(normal / np.linalg.norm(normal))
    d = float(point @ n)
    points = mesh.corners[np.unique(mesh.triangles[triangles])]
    return Region("plane", triangles, float(np.abs(points @ n - d).max()), direction=n, point=d * n)


def round_region(mesh: Mesh, triangles: Any, surface: Round, hole: bool, turn: float) -> Region:
    """Triangles on a cylinder or a cone, with the ends of it."""
    # An axis has no sense of its own: its largest component is taken as positive, and its point is the foot of the
    # origin, so that one file gives the same numbers each time.
    axis = surface.axis * np.sign(surface.axis[int(np.abs(surface.axis).argmax())])
    slope = surface.slope * float(np.sign(axis @ surface.axis))
    axis = _snapped(axis)
    point = surface.point - surface.point @ axis * axis
    foot = float(surface.point @ axis)
    every = np.unique(mesh.triangles[triangles])
    height, distance, _ = Region("cylinder", triangles, direction=axis, point=point).polar(mesh.corners[every])
    low = float(height.min())
    high = float(height.max())
    radii = [max(surface.radius + slope * (h - foot), 0.0) for h in (low, high)]
    if slope:
        radii = [0.0 if r < ON_WALL * mesh.extent else r for r in radii]
    # How far corners of the border are from the nearer end: of a square wall all of them are on one of the two.
    on_border = np.isin(every, border_of(mesh, triangles))
    ends = np.minimum(height - low, high - height)[on_border]
    off = (distance - radii[0] - slope * (height - low)) / np.hypot(1.0, slope)
    on = off > -ON_WALL * mesh.extent
    return Region(
        "cone" if slope else "cylinder",
        triangles,
        float(np.abs(off[on]).max(initial=0.0)),
        direction=axis,
        point=point,
        span=(low, high),
        radii=(radii[0], radii[1]),
        hole=hole,
        turn=turn,
        square=turn == WHOLE_TURN and bool(ends.max(initial=0.0) < 2.0 * FLAT * mesh.extent + 1e-9 and on.all()),
    )


def _snapped(n: Array) -> Array:
    """A direction along an axis of the frame, if it is so within rounding."""
    axis = int(np.abs(n).argmax())
    exact = np.sign(n[axis]) * np.eye(3)[axis]
    return exact if np.linalg.norm(n - exact) < _SNAP_RAD else n


def border_of(mesh: Mesh, triangles: Any) -> Any:
    """Corners on the border of a region."""
    inside = np.zeros(len(mesh.triangles), dtype=bool)
    inside[triangles] = True
    return np.unique(mesh.edges[inside[mesh.neighbours].sum(axis=1) == 1])
