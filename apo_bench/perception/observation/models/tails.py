"""The distribution of errors across a ray and along it: independent Student t, within a limit.

Across there are two equal directions, along there is one. The same form serves for shifts [mm] and for turns [deg]
(about axes across the ray, and about the ray). All integrals over the limited region are taken along the ray, by Gauss
and Legendre in y with x = s sinh(y), which is dense where the density is high, however long its tail; across, they have
a closed form.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, final

import numpy as np
from numpy.typing import ArrayLike

from apo_bench.geometry import Array

_NODES = 160
_GAUSS = 200.0
"""Student t with more degrees of freedom counts as Gaussian, infinitely many."""
_X, _W = np.polynomial.legendre.leggauss(_NODES)


class Tail(NamedTuple):
    """Student t about zero: its scale, and its degrees of freedom, infinite for a Gaussian."""

    scale: float
    freedom: float = float("inf")

    @property
    def heaviness(self) -> float:
        """1 / degrees of freedom: 0 for a Gaussian."""
        return 1.0 / self.freedom if self.freedom < _GAUSS else 0.0


@final
@dataclass(frozen=True)
class Split:
    """The distribution of errors (x, y, along)."""

    across: Tail
    along: Tail
    limit: float
    """No error is longer."""

    @cached_property
    def _nodes(self) -> tuple[Array, Array]:
        """Places along the ray and what each stands for: density times weight, before the limit across."""
        s = self.along.scale
        top = np.arcsinh(self.limit / self.along.scale)
        y = top * _X
        x = s * np.sinh(y)
        return x, top * _W * s * np.cosh(y) * np.exp(compute_log_density_along(self.along, x))

    @cached_property
    def inside(self) -> float:
        """The part of the unlimited distribution that is within the limit."""
        x, w = self._nodes
        return float(w @ _below_across(self.across, self._left(x, self.limit)))

    @cached_property
    def variances(self) -> tuple[float, float]:
        """The variance in one direction across and in the one along, within the limit."""
        x, w = self._nodes
        left = self._left(x, self.limit)
        across = float(w @ _square_below(self.across, left)) / self.inside / 2.0
        return across, float(w @ (x * x * _below_across(self.across, left))) / self.inside

    def cdf_across(self, r: ArrayLike) -> Array:
        """The cumulative distribution of the length of the error across."""
        r = np.asarray(r, dtype=np.float64)
        x, w = self._nodes
        return _below_across(self.across, np.minimum(r[..., None], self._left(x, self.limit))) @ w / self.inside

    def cdf_along(self, a: ArrayLike) -> Array:
        """The cumulative distribution of the size of the error along."""
        x, w, _ = self._nodes_to(a)
        return np.sum(w * _below_across(self.across, self._left(x, self.limit)), axis=-1) / self.inside

    def cdf_length(self, r: ArrayLike) -> Array:
        """The cumulative distribution of the length of the whole error."""
        x, w, end = self._nodes_to(r)
        return np.sum(w * _below_across(self.across, self._left(x, end)), axis=-1) / self.inside

    def _nodes_to(self, end: ArrayLike) -> tuple[Array, Array, Array]:
        """As `_nodes`, from -end to end, (*, nodes) each, and the ends within the limit, (*, 1)."""
        end = np.minimum(np.asarray(end, dtype=np.float64), self.limit)[..., None]
        # x = s sinh(y), so dx = s cosh(y) dy = hypot(s, x) dy, and y runs to asinh(end / s).
        top = np.arcsinh(end / self.along.scale)
        x = self.along.scale * np.sinh(top * _X)
        return x, top * _W * np.hypot(self.along.scale, x) * np.exp(compute_log_density_along(self.along, x)), end

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """Errors (n, 3); what falls outside the limit is drawn again."""
        kept = np.zeros((0, 3))
        while len(kept) < n:
            # Student t is a Gaussian over sqrt(chi-square(n) / n): one divisor for both directions across, one along.
            error = rng.standard_normal((n, 3)) * [self.across.scale, self.across.scale, self.along.scale]
            error[:, :2] /= _root_chi(self.across, n, rng)[:, None]
            error[:, 2] /= _root_chi(self.along, n, rng)
            kept = np.concatenate([kept, error[np.linalg.norm(error, axis=1) < self.limit]])
        return kept[:n]

    @staticmethod
    def _left(x: Array, limit: ArrayLike) -> Array:
        """How much is left across at a place along."""
        return np.sqrt(np.maximum(np.asarray(limit) ** 2 - x * x, 0.0))


def unpack_tails(at: Array, limit: float) -> Split:
    """From four numbers to fit: logarithm of the scale and inverse of the degrees of freedom, across, then along."""
    tails = [Tail(float(np.exp(s)), float(1.0 / h) if h > 1.0 / _GAUSS else float("inf")) for s, h in (at[:2], at[2:])]
    return Split(tails[0], tails[1], limit)


def compute_log_density_along(tail: Tail, x: Array) -> Array:
    """The logarithm of the density of Student t in one direction."""
    from scipy.special import gammaln

    h = tail.heaviness
    u = (x / tail.scale) ** 2
    if h == 0.0:
        return -u / 2.0 - np.log(tail.scale * np.sqrt(2.0 * np.pi))
    n = 1.0 / h
    norm = gammaln((n + 1.0) / 2.0) - gammaln(n / 2.0) - 0.5 * np.log(np.pi * n) - np.log(tail.scale)
    return np.asarray(norm - (n + 1.0) / 2.0 * np.log1p(h * u))


def compute_log_density_across(tail: Tail, r: Array) -> Array:
    """The logarithm of the density, per area, of Student t in two directions, at a distance r."""
    h = tail.heaviness
    u = (r / tail.scale) ** 2
    falls = u / 2.0 if h == 0.0 else (0.5 / h + 1.0) * np.log1p(h * u)
    return np.asarray(-falls - np.log(2.0 * np.pi * tail.scale**2))


def _below_across(tail: Tail, r: Array) -> Array:
    """The chance that Student t in two directions is nearer than r."""
    # 1 - (1 + r^2 / (n s^2))^(-n / 2); of a Gaussian 1 - exp(-r^2 / 2 s^2).
    h = tail.heaviness
    u = (r / tail.scale) ** 2
    return np.asarray(-np.expm1(-u / 2.0 if h == 0.0 else -0.5 / h * np.log1p(h * u)))


def _square_below(tail: Tail, r: Array) -> Array:
    """Integral of the squared distance times the density up to r: that of 2 r (1 - F) less r^2 (1 - F)."""
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


def _root_chi(tail: Tail, n: int, rng: np.random.Generator) -> Array:
    """What a Gaussian is divided by to make it Student t, (n,)."""
    return np.sqrt(rng.chisquare(tail.freedom, n) / tail.freedom) if tail.heaviness > 0.0 else np.ones(n)
