"""The mean of a bounded quantity over seeds: a likelihood interval that asks for no distribution.

Each seed gives one number between two bounds. A mean is believed unless the likeliest distribution between the bounds
that has it is much less likely than what was seen. That is A. B. Owen's empirical likelihood (Biometrika 75, 1988,
237-249), except that the bounds themselves may carry probability though no seed was there, so that a sample without any
spread still has an interval. Twice the log ratio is held against Fisher's F with 1 and n - 1 degrees of freedom, which
for many seeds is the chi-square of Wilks' theorem and for few is what Student's t would ask for (Owen's advice).
"""

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.statistics.rates import CONFIDENCE, Interval

_STEPS = 48
"""Halvings: what is left is less than 1e-14 of the range."""


def threshold(seeds: int) -> float:
    """What twice the log likelihood ratio stays below in 95 of 100 samples; infinite with a single seed or none."""
    from scipy.special import fdtri

    return float(fdtri(1, seeds - 1, CONFIDENCE)) if seeds > 1 else float("inf")


def surprise(
    values: Array, counts: Array, mean: Array | float, low: Array | float = 0.0, high: Array | float = 1.0
) -> Array:
    """Twice the log likelihood ratio of a mean.

    The likeliest weights are n_i / (n (1 + a (x_i - mean))); what they leave over lies on a bound. Twice the log ratio
    is the largest 2 sum n_i log(1 + a (x_i - mean)) over all a that keep the weights positive at both bounds.

    Args:
        values: (..., k) from `low` to `high`.
        counts: (..., k) how many seeds had each value.
        mean: (...), strictly between `low` and `high`, which are (...) too, or numbers.

    Returns:
        (...), 0 where the mean is that of the sample.
    """
    z = values - np.asarray(mean)[..., None]
    least = np.broadcast_to(-1.0 / (high - np.asarray(mean)), z.shape[:-1]).copy()
    most = np.broadcast_to(1.0 / (np.asarray(mean) - low), z.shape[:-1]).copy()
    for _ in range(_STEPS):
        a = 0.5 * (least + most)
        rising = (counts * z / np.where(counts > 0, 1.0 + a[..., None] * z, 1.0)).sum(-1) > 0.0
        least = np.where(rising, a, least)
        most = np.where(rising, most, a)
    grown = np.where(counts > 0, 1.0 + (0.5 * (least + most))[..., None] * z, 1.0)
    return np.asarray(2.0 * (counts * np.log(np.maximum(grown, 1e-300))).sum(-1))


def mean_interval(values: Array, low: float = 0.0, high: float = 1.0) -> Interval:
    """The means that are not too surprising at 95 %; nothing is known without a value.

    Args:
        values: (n,) from `low` to `high`, one per seed.
    """
    if len(values) == 0:
        return Interval(low, high)
    different, counts = np.unique(np.asarray(values, dtype=float), return_counts=True)
    sample = float(np.clip((different * counts).sum() / counts.sum(), low, high))
    seen = (different, counts.astype(float), low, high)
    return Interval(_end(*seen, sample, low), _end(*seen, sample, high))


def _end(values: Array, counts: Array, low: float, high: float, inside: float, outside: float) -> float:
    """Where between the mean of the sample and a bound the surprise reaches its threshold."""
    if inside == outside:
        return outside
    most = threshold(int(counts.sum()))
    parts = np.linspace(0.0, 1.0, 34)[1:-1]
    for _ in range(6):
        means = inside + parts * (outside - inside)
        believed = int((surprise(values, counts, means, low, high) <= most).sum())
        inside, outside = ((inside, *means, outside)[i] for i in (believed, believed + 1))
    return float(inside)
