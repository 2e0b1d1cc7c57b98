"""Success that falls with the logarithm of the level, fitted by likelihood: a curve below a ceiling, lopsided or not.

Success at level L is c g(b (log h - log L) + s): h is the level at which it is one half, b the steepness, c the ceiling
(a share 1 - c fails whatever the level: lapses; F. A. Wichmann and N. J. Hill, The psychometric function I, Perception
and Psychophysics 63, 2001, 1293-1313), and s is such that one half is at h. The shape g is normal, or logistic to a
power, or one minus the mirror image of that: from curves that leave the ceiling early to such that reach the floor
early. The likelihood is looked up on a grid of (h, b, c, g), so data that fall from all to nothing between two levels,
whose steepness has no largest likelihood, are no special case.

Levels of a seed share its luck, which a likelihood of independent trials does not know. Twice its log ratio is divided
by how much more the score of h varies from seed to seed than the likelihood says (J. N. K. Rao and A. J. Scott, Annals
of Statistics 12, 1984, 46-60; here never by less than 1).
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array

_STEEPNESS = np.geomspace(0.4, 40.0, 18)
"""Per unit of the natural logarithm: from hardly falling to a step."""
_CEILINGS = np.array([1.0, 0.98, 0.95, 0.9, 0.82, 0.7, 0.6])
_POWERS = np.array([-12.0, -3.0, 0.0, 1.0, 3.0, 12.0])
"""Of the shape; those of the mirror image are negative, and 0 stands for the normal curve."""
CURVE_SHAPES = tuple(x.ravel() for x in np.meshgrid(_STEEPNESS, _CEILINGS, _POWERS, indexing="ij"))
"""(m,) steepness, ceiling and power of every curve that has a half level."""
_CONSTANTS = 4
"""Of a curve: half level, steepness, ceiling, power."""
_PER_UNIT = 40
"""Half levels per unit of the logarithm, between the smallest and the largest level."""
_OUTSIDE = np.array([0.05, 0.2, 0.5, 1.0, 2.0, 4.0])
"""How far beyond them others lie: enough to know that the likeliest is there."""
_NORMAL = 0.6
"""A normal curve of this times the steepness is about as steep as the logistic one."""
_LEAST = 1e-9
_STEP = 1e-4


class Profile(NamedTuple):
    """How surprising every half level is."""

    log_half: Array
    """(m,) rising logarithms of half levels."""
    surprise: Array
    """(..., m) twice the log likelihood ratio to the likeliest, the luck of seeds allowed for."""


def profile(log_levels: Array, success: Array) -> Profile:
    """The profile of the half level.

    Args:
        log_levels: (k,) rising.
        success: (..., n, k) of n seeds: 1, 0, or NaN where there is no result.
    """
    known = ~np.isnan(success)
    right = np.where(known, success, 0.0)
    k = right.sum(axis=-2)
    wrong = (known - right).sum(axis=-2)
    log_half, log_p, log_q = _table(tuple(log_levels.tolist()))
    # sum over levels of k log p + (n - k) log (1 - p), for every half level and every shape of the grid
    likelihood = (k @ log_p + wrong @ log_q).reshape(*k.shape[:-1], len(log_half), len(CURVE_SHAPES[0]))
    # profile: at each half level the shape that is likeliest there
    best = likelihood.max(axis=-1)
    which = likelihood.argmax(axis=-1)
    at = best.argmax(axis=-1)[..., None]
    likeliest = np.take_along_axis(which, at, axis=-1)
    more = variation(log_levels, right, known, log_half[at], tuple(x[likeliest] for x in CURVE_SHAPES))
    more *= misfit(k, wrong, best.max(axis=-1))
    return Profile(log_half, 2.0 * (best.max(axis=-1, keepdims=True) - best) / more[..., None])


def curve(log_levels: Array, log_half: Array, steepness: Array, ceiling: Array, power: Array) -> Array:
    """Success at levels; everything is broadcast together."""
    from scipy.special import expit, logit, ndtr, ndtri

    half = 0.5 / ceiling
    # ceiling * g(0 + shift) = 1/2 at log_half: the shift is the inverse of g at half
    normal = ceiling * ndtr(_NORMAL * steepness * (log_half - log_levels) + ndtri(half))
    mirrored = power < 0
    n = np.maximum(1.0, np.abs(power))
    shift = np.where(mirrored, -logit((1.0 - half) ** (1.0 / n)), logit(half ** (1.0 / n)))
    x = steepness * (log_half - log_levels) + shift
    lopsided = ceiling * np.where(mirrored, 1.0 - expit(-x) ** n, expit(x) ** n)
    return np.asarray(np.where(power == 0, normal, lopsided))


def variation(log_levels: Array, right: Array, known: Array, log_half: Array, others: tuple[Array, ...]) -> Array:
    """(...) how much more the score of the half level varies between seeds than if trials were independent.

    Args:
        right, known: (..., n, k).
        log_half: (..., 1) of the likeliest curve, and `others` (..., 1) its steepness, ceiling and power.
    """
    steepness, ceiling, power = others

    def at(half: float, steeper: float) -> Array:
        return curve(log_levels, log_half + half, steepness * (1.0 + steeper), ceiling, power)

    p = np.clip(at(0.0, 0.0), _LEAST, 1.0 - _LEAST)
    # derivatives of success by the half level and by the steepness, as central differences
    by_half = (at(_STEP, 0.0) - at(-_STEP, 0.0)) / (2 * _STEP)
    by_steepness = (at(0.0, _STEP) - at(0.0, -_STEP)) / (2 * _STEP)
    # Fisher's information of both, if trials were independent: sum of n dp dp' / (p (1 - p))
    weight = known.sum(axis=-2) / (p * (1.0 - p))
    hh, hs, ss = (
        (weight * x).sum(axis=-1, keepdims=True) for x in (by_half**2, by_half * by_steepness, by_steepness**2)
    )
    # the score of the half level with that of the steepness taken out, as the steepness was fitted too
    free = np.where(ss > _LEAST, hs / np.maximum(ss, _LEAST), 0.0)
    direction = (by_half - free * by_steepness) / (p * (1.0 - p))
    scores = (np.where(known, right - p[..., None, :], 0.0) * direction[..., None, :]).sum(axis=-1)
    # its variance as the seeds say, over that which the likelihood says
    expected = (hh - free * hs)[..., 0]
    ratio = (scores**2).sum(axis=-1) / np.maximum(expected, _LEAST)
    return np.asarray(np.maximum(1.0, np.where(expected > _LEAST, ratio, 1.0)))


def misfit(right: Array, wrong: Array, likelihood: Array) -> Array:
    """(...) by how much the deviance of the likeliest curve exceeds what chance explains; 1 where it does not.

    The heterogeneity factor of D. J. Finney, Probit Analysis, 1952: where no curve of the grid fits, as with thousands
    of seeds, curves that fit little worse than the likeliest are believed too.

    Args:
        right, wrong: (..., k) successes and failures at the levels.
    """
    from scipy.special import chdtri, xlogy

    trials = np.maximum(right + wrong, 1.0)
    # likelihood of a model with a rate of its own at each level; twice what it is better by is the deviance
    best = (xlogy(right, right / trials) + xlogy(wrong, wrong / trials)).sum(axis=-1)
    return np.asarray(np.maximum(1.0, 2.0 * (best - likelihood) / chdtri(max(1, right.shape[-1] - _CONSTANTS), 0.05)))


@lru_cache(maxsize=8)
def _table(log_levels: tuple[float, ...]) -> tuple[Array, Array, Array]:
    """The half levels (m,), and (k, m * others) the logarithms of success and failure of every curve."""
    x = np.array(log_levels)
    h = np.unique(
        np.r_[x[0] - _OUTSIDE, np.linspace(x[0], x[-1], 2 + int(_PER_UNIT * (x[-1] - x[0]))), x[-1] + _OUTSIDE]
    )
    p = curve(x[:, None, None], h[:, None], *CURVE_SHAPES)
    p = np.clip(p, _LEAST, 1.0 - _LEAST).reshape(len(x), -1)
    return h, np.log(p), np.log1p(-p)
