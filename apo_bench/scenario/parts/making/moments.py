"""Exact moments of flat and solid shapes up to second order, for volume, centroid and inertia."""

from collections.abc import Iterable
from functools import reduce
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array


class Moments(NamedTuple):
    """The integrals of 1, x and x x^T over a shape; x is (2,) for a flat one, (3,) for a solid."""

    size: float
    """Area or volume."""
    first: Array
    """(2,) or (3,)."""
    second: Array
    """(2, 2) or (3, 3)."""

    def plus(self, other: "Moments", sign: float = 1.0) -> "Moments":
        """The sum with those of another shape; the difference if `sign` is -1."""
        return Moments(
            self.size + sign * other.size, self.first + sign * other.first, self.second + sign * other.second
        )

    def moved(self, R: Array, t: Array) -> "Moments":
        """The moments of the shape after x -> R x + t."""
        m = R @ self.first
        second = R @ self.second @ R.T + np.outer(m, t) + np.outer(t, m) + self.size * np.outer(t, t)
        return Moments(self.size, m + self.size * t, second)

    @property
    def in_metres(self) -> "Moments":
        """The moments of a solid converted from mm to m."""
        return Moments(1e-9 * self.size, 1e-12 * self.first, 1e-15 * self.second)

    @property
    def centroid(self) -> Array:
        return np.asarray(self.first / self.size)

    @property
    def inertia(self) -> Array:
        """The inertia (3, 3) about the centroid, for density 1."""
        S = self.second - self.size * np.outer(self.centroid, self.centroid)
        return np.asarray(np.trace(S) * np.eye(3) - S)


def sum_moments(first: Moments, others: Iterable[Moments], sign: float = 1.0) -> Moments:
    """Add the moments of other shapes, or subtract them if `sign` is -1."""
    return reduce(lambda moments, other: moments.plus(other, sign), others, first)


def compute_polygon_moments(ring: Array) -> Moments:
    """The moments of the area inside a counter-clockwise ring (k, 2)."""
    x, y = ring.T
    u, v = np.roll(ring, -1, axis=0).T
    # Green's theorem over the edges from (x, y) to (u, v); c is twice the area of the triangle with the origin.
    c = x * v - u * y
    first = np.array([(x + u) @ c, (y + v) @ c]) / 6.0
    xx = (x * x + x * u + u * u) @ c / 12.0
    yy = (y * y + y * v + v * v) @ c / 12.0
    xy = (x * v + 2.0 * x * y + 2.0 * u * v + u * y) @ c / 24.0
    return Moments(float(c.sum() / 2.0), first, np.array([[xx, xy], [xy, yy]]))


def compute_segment_moments(center: Array, radius: float, middle: float, extent: float) -> Moments:
    """The moments of the circular segment between an arc and its chord.

    Args:
        center: (2,), centre of the circle.
        middle: Direction from the centre to the middle of the arc, [rad].
        extent: Angle of the arc, [rad].
    """
    a = extent / 2.0
    r = radius
    s = np.sin(a)
    c = np.cos(a)
    sector = Moments(
        a * r**2, np.array([2.0 * r**3 * s / 3.0, 0.0]), np.diag([r**4 * (a + s * c), r**4 * (a - s * c)]) / 4.0
    )
    chord = compute_polygon_moments(np.array([[0.0, 0.0], [r * c, -r * s], [r * c, r * s]]))
    R = np.array([[np.cos(middle), -np.sin(middle)], [np.sin(middle), np.cos(middle)]])
    return sector.plus(chord, -1.0).moved(R, center)


def extrude_moments(flat: Moments, low: float, high: float) -> Moments:
    """The moments of the prism over a flat shape between two heights."""
    h = high - low
    z1 = (high**2 - low**2) / 2.0
    z2 = (high**3 - low**3) / 3.0
    second = np.zeros((3, 3))
    second[:2, :2] = h * flat.second
    second[:2, 2] = second[2, :2] = z1 * flat.first
    second[2, 2] = z2 * flat.size
    return Moments(h * flat.size, np.append(h * flat.first, z1 * flat.size), second)


def compute_frustum_moments(low: float, high: float, r_low: float, r_high: float) -> Moments:
    """The moments of a cylinder or a truncated cone about the z axis, between two heights with their radii."""
    # The radius is linear in z, so the integrands are polynomials: up to degree 7 four Gauss points are exact.
    nodes, weights = np.polynomial.legendre.leggauss(4)
    z = low + (high - low) * (nodes + 1.0) / 2.0
    r = r_low + (r_high - r_low) * (nodes + 1.0) / 2.0
    w = weights * (high - low) / 2.0
    area = np.pi * r**2
    cross = np.pi * r**4 / 4.0
    first = np.array([0.0, 0.0, float(w @ (area * z))])
    return Moments(float(w @ area), first, np.diag([w @ cross, w @ cross, w @ (area * z**2)]))
