"""Fit planes, cylinders and cones to flat pieces of a surface, and find the pieces on them and their ends."""

from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from apo_bench.geometry import WHOLE_TURN, Array
from apo_bench.importers.cad.faces.facets import FLAT, Facets
from apo_bench.importers.cad.solids import Mesh, Region, find_square_axes

_MOST_POINTS = 400
_TURNED = 0.09
"""How far a flat piece may be turned from its round face, beyond half of the angle that it spans, [rad]."""
_WIDEST = 1.6
"""No strip of a round face is wider than most by this factor, unless all of it is near to the face."""
NEAR_MM = 0.02
"""Sides stand for a round face if they, and their corners, are this near to it."""
ON_WALL = 1e-5
"""Of the size of a part: corners of a round face are this near to it."""
_SNAP_RAD = 2e-6
_FULL_RAD = 1e-6


class Round(NamedTuple):
    """A cylinder, or a cone, that has no ends."""

    point: Array
    axis: Array
    radius: float
    """At the point."""
    slope: float
    """By how much it grows along the axis."""

    def polar(self, points: Array) -> tuple[Array, Array, Array]:
        """Height, distance from the axis, and the way from it, (k, 3)."""
        off = points - self.point
        height = off @ self.axis
        out = off - height[:, None] * self.axis
        distance = np.linalg.norm(out, axis=1)
        return height, distance, out / np.maximum(distance, 1e-300)[:, None]

    def off(self, points: Array) -> Array:
        """Return how far points are outside of it, square to its wall, (k,)."""
        height, distance, _ = self.polar(points)
        return (distance - self.radius - self.slope * height) / np.hypot(1.0, self.slope)

    def normals(self, out: Array) -> Array:
        """Return outward normals where the way from the axis is `out`, (k, 3)."""
        return (out - self.slope * self.axis) / np.hypot(1.0, self.slope)


def circle_through(points: Array, axis: Array) -> Round | None:
    """Return the cylinder along an axis nearest to points."""
    x, y = find_square_axes(axis)
    middle = points.mean(axis=0)
    u = (points - middle) @ x
    v = (points - middle) @ y
    size = float(np.abs([u, v]).max())
    if size < 1e-12:
        return None
    # Kasa 1976: u^2 + v^2 = 2 a u + 2 b v + c is linear in the middle (a, b) and c = r^2 - a^2 - b^2.
    A = np.column_stack([u / size, v / size, np.ones(len(u))])
    solution, _, rank, _ = np.linalg.lstsq(A, (u * u + v * v) / size**2, rcond=1e-9)
    if rank < 3 or not np.isfinite(solution).all():
        return None
    a, b = solution[:2] / 2.0
    radius = float(np.sqrt(max(solution[2] + a * a + b * b, 0.0)))
    return Round(middle + size * (a * x + b * y), axis, size * radius, 0.0)


def refine_round(start: Round | None, points: Array, cone: bool) -> Round | None:
    """Return the wall nearest to points by least squares: distances square to the wall, Levenberg-Marquardt.

    None: there is no start, there are too few points, or nothing fits.
    """
    if start is None:
        return None
    points = points[:: -(-len(points) // _MOST_POINTS)]
    middle = points.mean(axis=0)
    height, distance, _ = start.polar(points)
    # The point of the axis next to the middle of the points, so that turns of the axis and the radius hardly interact.
    at = start.point + (middle - start.point) @ start.axis * start.axis
    size = max(float(np.ptp(points, axis=0).max()), 1e-300)
    x, y = find_square_axes(start.axis)
    slope = 0.0
    radius = float(distance.mean())
    if cone:
        if not np.ptp(height) or not np.isfinite(height).all():
            return None
        slope, radius = np.polyfit(height - (middle - start.point) @ start.axis, distance, 1)

    def moved(p: Array) -> Round:
        """By p: two turns of the axis, two shifts across it, the radius (all in sizes), the slope of a cone."""
        axis = start.axis + p[0] * x + p[1] * y
        axis = axis / np.linalg.norm(axis)
        return Round(at + size * (p[2] * x + p[3] * y), axis, size * p[4], p[5] if cone else 0.0)

    def off(p: Array) -> Array:
        return np.asarray(moved(p).off(points) / size)

    first = [0.0, 0.0, 0.0, 0.0, radius / size, *([slope] if cone else [])]
    if len(points) < len(first) or not np.isfinite(off(np.array(first))).all():
        return None
    solved = least_squares(off, first, method="lm", xtol=1e-10, ftol=1e-8, gtol=1e-14, max_nfev=500)
    fitted = moved(solved.x)
    return fitted if np.isfinite(solved.x).all() and fitted.radius > 0.0 else None


def facets_on(mesh: Mesh, facets: Facets, among: Any, wall: Round, tolerance: float) -> tuple[Any, bool, Array]:
    """Return which flat pieces lie on a round surface.

    Args:
        among: The pieces to measure, ascending.

    Returns:
        Those that do; whether it is a hole; and the angle that each spans, [rad].
    """
    # Corners of these pieces, piece by piece: `rows` of the table of corners, `starts` of each piece in them.
    first = np.searchsorted(facets.owner, among, side="left")
    counts = np.searchsorted(facets.owner, among, side="right") - first
    starts = np.cumsum([0, *counts[:-1]])
    rows = np.repeat(first - starts, counts) + np.arange(counts.sum())
    owner = np.repeat(np.arange(len(among)), counts)
    height, distance, out = wall.polar(mesh.corners[facets.corner[rows]])
    _, _, outward = wall.polar(facets.centers[among])
    facing = (facets.normals[among] * wall.normals(outward)).sum(axis=1)
    # The angle of each corner about the axis from the middle of its piece; a corner on the axis has none.
    side = np.cross(wall.axis, outward)
    angle = np.arctan2((out * side[owner]).sum(axis=1), (out * outward[owner]).sum(axis=1))
    angle = np.where(distance < tolerance, 0.0, angle)
    span = np.maximum.reduceat(angle, starts) - np.minimum.reduceat(angle, starts)
    # Corners lie on the wall, or inside of it by up to the sagitta r (1 - cos(span / 2)) of a chord.
    wide = wall.radius + wall.slope * height
    off = (distance - wide) / np.hypot(1.0, wall.slope)
    sagitta = (wide * (1.0 - np.cos(np.minimum(span, facets.widest)[owner] / 2.0))).clip(0.0)
    fine = (off < tolerance) & (off > -tolerance - sagitta)
    good = np.logical_and.reduceat(fine, starts) & (span < facets.widest)
    good &= np.abs(facing) > np.cos(np.minimum(span / 2.0 + _TURNED, 1.0))
    if not good.any():
        return among[good], False, span[good]
    # A hole if most of the area faces the axis; the other pieces are of another face.
    hole = bool((np.sign(facing[good]) * facets.areas[among][good]).sum() < 0.0)
    good &= (facing < 0.0) == hole
    if good.any():
        sagittas = np.maximum.reduceat(sagitta, starts)
        good &= (span <= _WIDEST * np.median(span[good])) | (sagittas < NEAR_MM)
    return among[good], hole, span[good]


def axis_of(normals: Array, cone: bool) -> Array:
    """Return the direction to which normals are square, or have one angle: that in which they differ least."""
    rows = normals - normals.mean(axis=0) if cone else normals
    return np.asarray(np.linalg.svd(rows, full_matrices=len(rows) < 3)[2][2])


def fit_plane(mesh: Mesh, triangles: Any) -> Region:
    """Return the plane nearest to triangles that lie in one."""
    n = mesh.across[triangles].sum(axis=0)
    n = _snap(n / np.linalg.norm(n))
    middle = mesh.corners[mesh.triangles[triangles]].mean(axis=1)
    weight = np.linalg.norm(mesh.across[triangles], axis=1)
    return plane_region(triangles, n, float(weight @ (middle @ n) / weight.sum()) * n)


def plane_region(triangles: Any, normal: Array, point: Array) -> Region:
    """Return triangles on the plane through a point."""
    n = _snap(normal / np.linalg.norm(normal))
    return Region("plane", triangles, direction=n, point=float(point @ n) * n)


def round_region(mesh: Mesh, triangles: Any, surface: Round, hole: bool, turn: float, sides: int = 0) -> Region:
    """Return triangles on a cylinder or a cone, with the ends of it."""
    # An axis has no sense: its largest component is taken as positive, and its point is the foot of the
    # origin, so that one file gives the same numbers each time.
    axis = surface.axis * np.sign(surface.axis[int(np.abs(surface.axis).argmax())])
    slope = surface.slope * float(np.sign(axis @ surface.axis))
    axis = _snap(axis)
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
    ends = np.minimum(height - low, high - height)[np.isin(every, border_of(mesh, triangles))]
    off = (distance - radii[0] - slope * (height - low)) / np.hypot(1.0, slope)
    on = off > -ON_WALL * mesh.extent
    return Region(
        "cone" if slope else "cylinder",
        triangles,
        direction=axis,
        point=point,
        span=(low, high),
        radii=(radii[0], radii[1]),
        hole=hole,
        turn=turn,
        sides=sides,
        square=turn == WHOLE_TURN and bool(ends.max(initial=0.0) < 2.0 * FLAT * mesh.extent + 1e-9 and on.all()),
    )


def measure_wall_turn(mesh: Mesh, triangles: Any, wall: Round) -> float:
    """Return how far around its axis a wall reaches, as its triangles lie there, [rad]."""
    x, y = find_square_axes(wall.axis)
    _, distance, out = wall.polar(mesh.corners[mesh.triangles[triangles]].reshape(-1, 3))
    angle = np.arctan2(out @ y, out @ x).reshape(-1, 3)
    # Each triangle from its lowest to its highest angle, seen from one of its corners; one on the axis has no angle.
    sound = (distance > 1e-6 * distance.max()).reshape(-1, 3)
    first = angle[np.arange(len(angle)), sound.argmax(axis=1)]
    off = np.where(sound, (angle - first[:, None] + np.pi) % WHOLE_TURN - np.pi, 0.0)
    low = (first + off.min(axis=1)) % WHOLE_TURN
    order = np.argsort(low)
    high = (low + off.max(axis=1) - off.min(axis=1))[order]
    low = low[order]
    # Gaps between the farthest angle that was reached so far and the next lowest one, around the turn.
    reach = np.maximum.accumulate(high)
    gaps = np.append(low[1:], low[0] + WHOLE_TURN) - np.maximum(reach, reach[-1] - WHOLE_TURN)
    widest = float(gaps.max())
    return WHOLE_TURN if widest < _FULL_RAD else WHOLE_TURN - widest


def _snap(n: Array) -> Array:
    """A direction along an axis of the frame, if it is so within rounding."""
    axis = int(np.abs(n).argmax())
    exact = np.sign(n[axis]) * np.eye(3)[axis]
    return exact if np.linalg.norm(n - exact) < _SNAP_RAD else n


def border_of(mesh: Mesh, triangles: Any) -> Any:
    """Return corners on the border of a region."""
    inside = np.zeros(len(mesh.triangles), dtype=bool)
    inside[triangles] = True
    return np.unique(mesh.edges[inside[mesh.neighbours].sum(axis=1) == 1])
