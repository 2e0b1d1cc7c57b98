"""Cylinders and cones fitted to flat pieces of a surface, and what of it lies on them."""

from typing import Any, NamedTuple

import numpy as np

from apo_bench.cad.faces.facets import SMOOTH_RAD, Facets
from apo_bench.cad.raw_solid import Mesh, square_to
from apo_bench.geometry.arrays import Array

_MOST_POINTS = 400
_TURNED = 0.09
"""How far a flat piece may be turned from what it stands for, beside half of the angle that it spans, [rad]."""
_WIDEST = 1.6
"""No strip of a round face is this much wider than most of them."""


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
        """How far points are outside of it, square to its wall, (k,)."""
        height, distance, _ = self.polar(points)
        return (distance - self.radius - self.slope * height) / np.hypot(1.0, self.slope)

    def normals(self, out: Array) -> Array:
        """Outward normals where the way from the axis is `out`, (k, 3)."""
        return (out - self.slope * self.axis) / np.hypot(1.0, self.slope)


def circle_through(points: Array, axis: Array) -> Round | None:
    """The cylinder along an axis nearest to points."""
    x, y = square_to(axis)
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
    a = solution[0] / 2.0
    b = solution[1] / 2.0
    radius = float(np.sqrt(max(solution[2] + a * a + b * b, 0.0)))
    return Round(middle + size * (a * x + b * y), axis, size * radius, 0.0)


def refined(start: Round, points: Array, cone: bool) -> Round | None:
    """The nearest to points in the sense of least squares: distances square to the wall, Levenberg-Marquardt."""
    from scipy.optimize import least_squares

    points = points[:: -(-len(points) // _MOST_POINTS)]
    middle = points.mean(axis=0)
    height, distance, _ = start.polar(points)
    # The point of the axis beside the middle of the points, so that turns of the axis and the radius hardly interact.
    at = start.point + (middle - start.point) @ start.axis * start.axis
    size = max(float(np.ptp(points, axis=0).max()), 1e-300)
    x, y = square_to(start.axis)
    slope = 0.0
    radius = float(distance.mean())
    if cone:
        slope, radius = np.polyfit(height - (middle - start.point) @ start.axis, distance, 1)

    def moved(p: Array) -> Round:
        """By p: two turns of the axis, two shifts across it, the radius (all in sizes), the slope of a cone."""
        axis = start.axis + p[0] * x + p[1] * y
        axis = axis / np.linalg.norm(axis)
        return Round(at + size * (p[2] * x + p[3] * y), axis, size * p[4], p[5] if cone else 0.0)

    def off(p: Array) -> Array:
        each = moved(p)
        h, d, _ = each.polar(points)
        return np.asarray((d - each.radius - each.slope * h) / size / np.hypot(1.0, each.slope))

    first = [0.0, 0.0, 0.0, 0.0, radius / size, *([slope] if cone else [])]
    if len(points) < len(first):
        return None
    solved = least_squares(off, first, method="lm", xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=200)
    fitted = moved(solved.x)
    return fitted if np.isfinite(solved.x).all() and fitted.radius > 0.0 else None


def on_it(mesh: Mesh, facets: Facets, among: Any, wall: Round, tolerance: float) -> tuple[Any, bool, Array]:
    """Which flat pieces lie on a round surface.

    Args:
        among: Which ones to look at, ascending.

    Returns:
        Those that do; whether it is a hole; and the angle that each spans, [rad].
    """
    # Corners of these pieces, piece by piece: `rows` of the table of corners, `starts` of each piece in them.
    first = np.searchsorted(facets.owner, among, side="left")
    counts = np.searchsorted(facets.owner, among, side="right") - first
    starts = np.cumsum([0, *counts[:-1]])
    rows = np.repeat(first - starts, counts) + np.arange(counts.sum())
    owner = np.repeat(np.arange(len(among)), counts)
    points = mesh.corners[facets.corner[rows]]
    height, distance, out = wall.polar(points)
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
    sagitta = (wide * (1.0 - np.cos(np.minimum(span, SMOOTH_RAD)[owner] / 2.0))).clip(0.0)
    fine = (off < tolerance) & (off > -tolerance - sagitta)
    good = np.logical_and.reduceat(fine, starts) & (span < SMOOTH_RAD)
    good &= np.abs(facing) > np.cos(np.minimum(span / 2.0 + _TURNED, 1.0))
    if not good.any():
        return among[good], False, span[good]
    # A hole if most of the area looks to the axis; what looks the other way is of another face.
    hole = bool((np.sign(facing[good]) * facets.areas[among][good]).sum() < 0.0)
    good &= (facing < 0.0) == hole
    if good.any():
        good &= span <= _WIDEST * np.median(span[good])
    return among[good], hole, span[good]


def axis_of(normals: Array, cone: bool) -> Array:
    """The direction to which normals are square, or have one angle: that in which they differ least."""
    rows = normals - normals.mean(axis=0) if cone else normals
    return np.asarray(np.linalg.svd(rows, full_matrices=len(rows) < 3)[2][2])
