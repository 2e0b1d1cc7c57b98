"""Fit planes, cylinders and cones to facets, and find the facets on a fitted surface and its ends."""

from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from apo_bench.geometry import WHOLE_TURN, Array
from apo_bench.importers.cad.faces.facets import FLAT, Facets
from apo_bench.importers.cad.solids import Mesh, Region, find_square_axes

_MOST_POINTS = 400  # in a fit of a round surface
_TURNED = 0.09
"""Tolerance between the normals of a facet and of its round face, beyond half the angle that the facet spans, [rad]."""
_WIDEST = 1.6
"""The widest facet of a round face, over the median one; wider ones count only if they are near the face everywhere."""
NEAR_MM = 0.02
"""A facet is on a round face regardless of its width if its sagitta is below this."""
ON_WALL = 1e-5
"""Largest distance of corners from their round face, as a share of the size of a part."""
_SNAP_RAD = 2e-6  # an axis or normal nearer to an axis of the frame is set to it
_FULL_RAD = 1e-6  # a wall with no wider gap goes all the way round


class RoundSurface(NamedTuple):
    """An infinite cylinder or cone."""

    point: Array  # a point on the axis
    axis: Array  # unit vector
    radius: float
    """The radius at the point."""
    slope: float
    """Increase of the radius per length along the axis; 0 for a cylinder."""

    def polar(self, points: Array) -> tuple[Array, Array, Array]:
        """Return height along the axis, distance from it, (k,) each, and the unit direction away from it, (k, 3)."""
        off = points - self.point
        height = off @ self.axis
        out = off - height[:, None] * self.axis
        distance = np.linalg.norm(out, axis=1)
        return height, distance, out / np.maximum(distance, 1e-300)[:, None]

    def off(self, points: Array) -> Array:
        """Return the signed distance of points from the wall, positive outside, (k,)."""
        height, distance, _ = self.polar(points)
        return (distance - self.radius - self.slope * height) / np.hypot(1.0, self.slope)

    def normals(self, out: Array) -> Array:
        """Return outward unit normals of the wall, (k, 3), where the direction away from the axis is `out`, (k, 3)."""
        return (out - self.slope * self.axis) / np.hypot(1.0, self.slope)


def fit_circle(points: Array, axis: Array) -> RoundSurface | None:
    """Return the cylinder along a given axis through points, by least squares; None if the points fix no circle."""
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
    return RoundSurface(middle + size * (a * x + b * y), axis, size * radius, 0.0)


def refine_round(start: RoundSurface | None, points: Array, cone: bool) -> RoundSurface | None:
    """Return the cylinder or cone nearest to points: Levenberg-Marquardt on distances from the wall.

    Args:
        start: Where the iteration begins.
        cone: Whether the slope is free.

    Returns:
        None if there is no start, there are too few points, or the result is not finite.
    """
    if start is None:
        return None
    points = points[:: -(-len(points) // _MOST_POINTS)]  # every n-th point, so that at most _MOST_POINTS are left
    middle = points.mean(axis=0)
    height, distance, _ = start.polar(points)
    # The point of the axis nearest to the mean of the points, so that tilts of the axis and the radius hardly interact.
    at = start.point + (middle - start.point) @ start.axis * start.axis
    size = max(float(np.ptp(points, axis=0).max()), 1e-300)
    x, y = find_square_axes(start.axis)
    slope = 0.0
    radius = float(distance.mean())
    if cone:
        if not np.ptp(height) or not np.isfinite(height).all():
            return None
        slope, radius = np.polyfit(height - (middle - start.point) @ start.axis, distance, 1)

    def moved(p: Array) -> RoundSurface:
        """Return the surface with parameters p: two tilts of the axis, two shifts across it, radius, slope of a cone.

        Shifts and radius are shares of the size of the points.
        """
        axis = start.axis + p[0] * x + p[1] * y
        axis = axis / np.linalg.norm(axis)
        return RoundSurface(at + size * (p[2] * x + p[3] * y), axis, size * p[4], p[5] if cone else 0.0)

    def off(p: Array) -> Array:
        return np.asarray(moved(p).off(points) / size)

    def slopes(p: Array) -> Array:
        """Return the derivatives of `off`, (k, len(p)): height and distance change with the tilted and shifted axis."""
        wall = moved(p)
        height, _, out = wall.polar(points)
        tilts = np.array([x, y]) - np.outer([x @ wall.axis, y @ wall.axis], wall.axis)
        tilts /= np.linalg.norm(start.axis + p[0] * x + p[1] * y)
        shifts = size * np.array([x, y])
        ahead = np.column_stack([(points - wall.point) @ tilts.T, np.tile(-shifts @ wall.axis, (len(points), 1))])
        outward = np.column_stack([-height[:, None] * (out @ tilts.T), -out @ shifts.T])
        columns = [outward - wall.slope * ahead, np.full((len(points), 1), -size)]
        length = np.hypot(1.0, wall.slope)
        if cone:
            columns.append(-(height + wall.slope * wall.off(points) / length)[:, None])
        return np.asarray(np.column_stack(columns) / (length * size))

    first = [0.0, 0.0, 0.0, 0.0, radius / size, *([slope] if cone else [])]
    if len(points) < len(first) or not np.isfinite(off(np.array(first))).all():
        return None
    solved = least_squares(off, first, slopes, method="lm", xtol=1e-10, ftol=1e-8, gtol=1e-14, max_nfev=20)
    fitted = moved(solved.x)
    return fitted if np.isfinite(solved.x).all() and fitted.radius > 0.0 else None


def find_facets_on(
    mesh: Mesh, facets: Facets, among: Any, wall: RoundSurface, tolerance: float
) -> tuple[Any, bool, Array]:
    """Find the facets on a round surface.

    Args:
        among: Facets to test, ascending.
        tolerance: Largest distance from the wall, beyond the sagitta, [mm].

    Returns:
        The facets on it, whether it is the wall of a hole, and the angle that each facet spans about the axis, [rad].
    """
    # Corners of these facets, facet by facet: `rows` of the table of corners, `starts` of each facet in `rows`.
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
    # It is a hole if most of the area faces the axis; facets that face the other way belong to another face.
    hole = bool((np.sign(facing[good]) * facets.areas[among][good]).sum() < 0.0)
    good &= (facing < 0.0) == hole
    if good.any():
        sagittas = np.maximum.reduceat(sagitta, starts)
        good &= (span <= _WIDEST * np.median(span[good])) | (sagittas < NEAR_MM)
    return among[good], hole, span[good]


def fit_axis(normals: Array, cone: bool) -> Array:
    """Return the axis of a round face from facet normals, (3,): the direction in which the normals differ least.

    Normals of a cylinder are square to its axis, those of a cone at a constant angle, hence without their mean.
    """
    rows = normals - normals.mean(axis=0) if cone else normals
    # The right singular vector of the smallest singular value.
    return np.asarray(np.linalg.svd(rows, full_matrices=len(rows) < 3)[2][2])


def fit_plane(mesh: Mesh, triangles: Any) -> Region:
    """Return the region of coplanar triangles, with the plane nearest to them."""
    n = mesh.across[triangles].sum(axis=0)
    n = _snap_to_axis(n / np.linalg.norm(n))
    middle = mesh.corners[mesh.triangles[triangles]].mean(axis=1)
    weight = np.linalg.norm(mesh.across[triangles], axis=1)
    return make_plane_region(triangles, n, float(weight @ (middle @ n) / weight.sum()) * n)


def make_plane_region(triangles: Any, normal: Array, point: Array) -> Region:
    """Return the region of triangles on the plane through a point."""
    n = _snap_to_axis(normal / np.linalg.norm(normal))
    return Region("plane", triangles, direction=n, point=float(point @ n) * n)


def make_round_region(
    mesh: Mesh, triangles: Any, surface: RoundSurface, hole: bool, turn: float, sides: int = 0
) -> Region:
    """Return the region of triangles on a cylinder or a cone, with its two ends.

    Args:
        surface: The fitted surface.
        hole: Whether the wall faces its axis.
        turn: Angle that the wall covers about the axis, [rad].
        sides: Facets around a full turn in the mesh; 0: unknown.
    """
    # The sign of an axis is arbitrary: its largest component is made positive, and its point is the foot of the origin,
    # so that a file gives the same numbers each time.
    axis = surface.axis * np.sign(surface.axis[int(np.abs(surface.axis).argmax())])
    slope = surface.slope * float(np.sign(axis @ surface.axis))
    axis = _snap_to_axis(axis)
    point = surface.point - surface.point @ axis * axis
    foot = float(surface.point @ axis)  # height of the surface's own point over the new one
    every = np.unique(mesh.triangles[triangles])
    height, distance, _ = Region("cylinder", triangles, direction=axis, point=point).polar(mesh.corners[every])
    low = float(height.min())
    high = float(height.max())
    radii = [max(surface.radius + slope * (h - foot), 0.0) for h in (low, high)]
    if slope:
        radii = [0.0 if r < ON_WALL * mesh.extent else r for r in radii]  # snaps the tip of a cone to radius 0
    # Distance of each border corner from the nearer end; if both ends are level circles, it is 0 for all of them.
    ends = np.minimum(height - low, high - height)[np.isin(every, list_border_corners(mesh, triangles))]
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


def measure_wall_turn(mesh: Mesh, triangles: Any, wall: RoundSurface) -> float:
    """Return the angle about the axis that the triangles of a wall cover, [rad]."""
    x, y = find_square_axes(wall.axis)
    _, distance, out = wall.polar(mesh.corners[mesh.triangles[triangles]].reshape(-1, 3))
    angle = np.arctan2(out @ y, out @ x).reshape(-1, 3)
    # Angular range of each triangle, relative to one of its corners off the axis, where the angle is defined.
    sound = (distance > 1e-6 * distance.max()).reshape(-1, 3)
    first = angle[np.arange(len(angle)), sound.argmax(axis=1)]
    off = np.where(sound, (angle - first[:, None] + np.pi) % WHOLE_TURN - np.pi, 0.0)
    low = (first + off.min(axis=1)) % WHOLE_TURN
    order = np.argsort(low)
    high = (low + off.max(axis=1) - off.min(axis=1))[order]
    low = low[order]
    # Gaps between the largest angle covered so far and the next lower end, once around.
    reach = np.maximum.accumulate(high)
    gaps = np.append(low[1:], low[0] + WHOLE_TURN) - np.maximum(reach, reach[-1] - WHOLE_TURN)
    widest = float(gaps.max())
    return WHOLE_TURN if widest < _FULL_RAD else WHOLE_TURN - widest


def _snap_to_axis(n: Array) -> Array:
    """Return the direction, set to an axis of the frame if it differs only by rounding."""
    axis = int(np.abs(n).argmax())
    exact = np.sign(n[axis]) * np.eye(3)[axis]
    return exact if np.linalg.norm(n - exact) < _SNAP_RAD else n


def list_border_corners(mesh: Mesh, triangles: Any) -> Any:
    """Return the corners on the border of a region, ascending."""
    inside = np.zeros(len(mesh.triangles), dtype=bool)
    inside[triangles] = True
    return np.unique(mesh.edges[inside[mesh.neighbours].sum(axis=1) == 1])  # edges with one triangle inside
