"""The distribution of errors across and along a camera ray: independent Student t, truncated at a limit.

Across the ray there are two equal directions, along it one. The same form serves for shifts [mm] and for rotations
[deg] (about axes across the ray, and about the ray). Integrals along the ray use Gauss-Legendre quadrature in y with
x = s sinh(y), whose nodes are dense where the density is high. Across the ray they have a closed form.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, final

import numpy as np
from numpy.typing import ArrayLike

from apo_bench.geometry import Array

_NODES = 160
"""Nodes of the quadrature along the ray."""
_GAUSS = 200.0
"""A Student t with more degrees of freedom is taken as Gaussian."""
_X, _W = np.polynomial.legendre.leggauss(_NODES)


class StudentT(NamedTuple):
    """A Student t distribution about zero."""

    scale: float
    freedom: float = float("inf")
    """Degrees of freedom; infinite for a Gaussian."""

    @property
    def heaviness(self) -> float:
        """1 / degrees of freedom: 0 for a Gaussian."""
        return 1.0 / self.freedom if self.freedom < _GAUSS else 0.0


@final
@dataclass(frozen=True)
class TruncatedTails:
    """The distribution of error vectors (x, y, along), truncated at a length."""

    across: StudentT
    """Of (x, y), with a common scale factor of both."""
    along: StudentT
    limit: float
    """Largest length of an error vector."""

    @cached_property
    def _quadrature_nodes(self) -> tuple[Array, Array]:
        """Quadrature nodes along the ray (nodes,), and weights times density along the ray, (nodes,).

        The truncation across the ray is not included.
        """
        s = self.along.scale
        top = np.arcsinh(self.limit / self.along.scale)
        y = top * _X
        x = s * np.sinh(y)
        return x, top * _W * s * np.cosh(y) * np.exp(compute_log_density_along(self.along, x))

    @cached_property
    def probability_inside(self) -> float:
        """The probability of the untruncated distribution within the limit."""
        x, w = self._quadrature_nodes
        return float(w @ _cdf_across(self.across, self._remaining_length(x, self.limit)))

    @cached_property
    def variances(self) -> tuple[float, float]:
        """The variances of the truncated distribution: in one direction across, and along."""
        x, w = self._quadrature_nodes
        left = self._remaining_length(x, self.limit)
        across = float(w @ _partial_second_moment(self.across, left)) / self.probability_inside / 2.0
        return across, float(w @ (x * x * _cdf_across(self.across, left))) / self.probability_inside

    def cdf_across(self, r: ArrayLike) -> Array:
        """The cumulative distribution of the length of the error across, at lengths r of any shape."""
        r = np.asarray(r, dtype=np.float64)
        x, w = self._quadrature_nodes
        return (
            _cdf_across(self.across, np.minimum(r[..., None], self._remaining_length(x, self.limit)))
            @ w
            / self.probability_inside
        )

    def cdf_along(self, a: ArrayLike) -> Array:
        """The cumulative distribution of the absolute error along, at sizes a of any shape."""
        x, w, _ = self._quadrature_nodes_to(a)
        return (
            np.sum(w * _cdf_across(self.across, self._remaining_length(x, self.limit)), axis=-1)
            / self.probability_inside
        )

    def cdf_length(self, r: ArrayLike) -> Array:
        """The cumulative distribution of the length of the error vector, at lengths r of any shape."""
        x, w, end = self._quadrature_nodes_to(r)
        return np.sum(w * _cdf_across(self.across, self._remaining_length(x, end)), axis=-1) / self.probability_inside

    def _quadrature_nodes_to(self, end: ArrayLike) -> tuple[Array, Array, Array]:
        """Nodes and weights as `_quadrature_nodes`, for integrals from -end to end, (*, nodes) each.

        The third value is `end` clipped to the limit, (*, 1).
        """
        end = np.minimum(np.asarray(end, dtype=np.float64), self.limit)[..., None]
        # x = s sinh(y), so dx = s cosh(y) dy = hypot(s, x) dy, and y runs to asinh(end / s).
        top = np.arcsinh(end / self.along.scale)
        x = self.along.scale * np.sinh(top * _X)
        return x, top * _W * np.hypot(self.along.scale, x) * np.exp(compute_log_density_along(self.along, x)), end

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """Draw errors (n, 3): x, y, along; errors beyond the limit are drawn again."""
        kept = np.zeros((0, 3))
        while len(kept) < n:
            # Student t is a Gaussian over sqrt(chi-square(n) / n): one divisor for both directions across, one along.
            error = rng.standard_normal((n, 3)) * [self.across.scale, self.across.scale, self.along.scale]
            error[:, :2] /= _draw_student_divisors(self.across, n, rng)[:, None]
            error[:, 2] /= _draw_student_divisors(self.along, n, rng)
            kept = np.concatenate([kept, error[np.linalg.norm(error, axis=1) < self.limit]])
        return kept[:n]

    @staticmethod
    def _remaining_length(x: Array, limit: ArrayLike) -> Array:
        """The largest length across at positions x along the ray, for vectors up to the limit."""
        return np.sqrt(np.maximum(np.asarray(limit) ** 2 - x * x, 0.0))


def unpack_tails(at: Array, limit: float) -> TruncatedTails:
    """Make a distribution from the parameters of a fit.

    Args:
        at: (4,), logarithm of the scale and inverse of the degrees of freedom, across, then along.
    """
    tails = [
        StudentT(float(np.exp(s)), float(1.0 / h) if h > 1.0 / _GAUSS else float("inf")) for s, h in (at[:2], at[2:])
    ]
    return TruncatedTails(tails[0], tails[1], limit)


def compute_log_density_along(tail: StudentT, x: Array) -> Array:
    """The log density of a one-dimensional Student t at x."""
    from scipy.special import gammaln

    h = tail.heaviness
    u = (x / tail.scale) ** 2
    if h == 0.0:
        return -u / 2.0 - np.log(tail.scale * np.sqrt(2.0 * np.pi))
    n = 1.0 / h
    norm = gammaln((n + 1.0) / 2.0) - gammaln(n / 2.0) - 0.5 * np.log(np.pi * n) - np.log(tail.scale)
    return np.asarray(norm - (n + 1.0) / 2.0 * np.log1p(h * u))


def compute_log_density_across(tail: StudentT, r: Array) -> Array:
    """The log density, per area, of a two-dimensional Student t at a distance r from its centre."""
    h = tail.heaviness
    u = (r / tail.scale) ** 2
    falls = u / 2.0 if h == 0.0 else (0.5 / h + 1.0) * np.log1p(h * u)
    return np.asarray(-falls - np.log(2.0 * np.pi * tail.scale**2))


def _cdf_across(tail: StudentT, r: Array) -> Array:
    """The probability that a two-dimensional Student t is nearer to its centre than r."""
    # 1 - (1 + r^2 / (n s^2))^(-n / 2); of a Gaussian 1 - exp(-r^2 / 2 s^2).
    h = tail.heaviness
    u = (r / tail.scale) ** 2
    return np.asarray(-np.expm1(-u / 2.0 if h == 0.0 else -0.5 / h * np.log1p(h * u)))


def _partial_second_moment(tail: StudentT, r: Array) -> Array:
    """The integral of squared distance times density of a two-dimensional Student t, up to distance r.

    By parts it is the integral of 2 r (1 - F), less r^2 (1 - F), with F as in `_cdf_across`.
    """
    h = tail.heaviness
    u = (r / tail.scale) ** 2
    s2 = tail.scale**2
    if h == 0.0:
        return np.asarray(-2.0 * s2 * np.expm1(-u / 2.0) - r * r * np.exp(-u / 2.0))
    # With F = 1 - (1 + h u)^(-1 / 2h) the first integral is s^2 / h ((1 + h u)^power - 1) / power, power = 1 - 1 / 2h;
    # log(1 + h u) where that is 0, at two degrees of freedom.
    grown = np.log1p(h * u)
    power = 1.0 - 0.5 / h
    whole = grown if abs(power) < 1e-9 else np.expm1(power * grown) / power
    return np.asarray(s2 / h * whole - r * r * np.exp(-0.5 / h * grown))


def _draw_student_divisors(tail: StudentT, n: int, rng: np.random.Generator) -> Array:
    """Draw the divisors (n,) that turn a Gaussian into a Student t: sqrt(chi-square / degrees of freedom)."""
    return np.sqrt(rng.chisquare(tail.freedom, n) / tail.freedom) if tail.heaviness > 0.0 else np.ones(n)
