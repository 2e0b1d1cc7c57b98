"""Fit an error distribution to published quantiles, where the estimates themselves are not published."""

from collections.abc import Mapping

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry import Array
from apo_bench.perception.observation.models import (
    LEAST_FREEDOM,
    SMALLEST_SCALE,
    StudentT,
    TruncatedTails,
    unpack_tails,
)

LOWER_QUARTILE_OF_THREE = 1.10115
"""Lower quartile of the length of a vector of three standard normal numbers (chi with three degrees of freedom)."""


def fit_split_to_quantiles(across: Mapping[float, float], along: Mapping[float, float], limit: float) -> TruncatedTails:
    """Fit a distribution to quantiles, by least squares of their logarithms.

    Args:
        across: Percentile -> size of the error across the camera ray; two or more.
        along: Percentile -> size of the error along the camera ray; two or more.
        limit: Largest error; the unit is that of the sizes.

    Raises:
        InputError: There are too few quantiles, or they do not grow, or they exceed the limit.
    """
    from scipy.optimize import least_squares

    for name, given in (("across", across), ("along", along)):
        sizes = [given[p] for p in sorted(given)]
        if len(given) < 2 or min(sizes) <= 0.0 or max(sizes) >= limit or sizes != sorted(sizes):
            raise InputError(
                f"the quantiles {dict(given)} {name} the ray were given; at least two are needed, which grow and stay "
                f"below {limit:g}."
            )
    target = np.log([*across.values(), *along.values()])
    grid = limit * np.linspace(0.0, 1.0, 801)[1:] ** 2

    def off(at: Array) -> Array:
        # Differences of the log quantiles; each is read off the cumulative distribution on a grid.
        split = unpack_tails(at, limit)
        sizes = [
            np.interp(np.array([*given]) / 100.0, np.maximum.accumulate(cdf(grid)), grid)
            for given, cdf in ((across, split.cdf_across), (along, split.cdf_along))
        ]
        return np.asarray(np.log(np.concatenate(sizes)) - target)

    start = [np.log(np.median([*across.values()])), 0.3, np.log(np.median([*along.values()])), 0.3]
    low = [np.log(SMALLEST_SCALE * limit), 0.0] * 2
    best = least_squares(off, start, bounds=(low, [np.log(limit), 1.0 / LEAST_FREEDOM] * 2), diff_step=1e-4)
    return unpack_tails(best.x, limit)


def make_round_split(lower_quartile: float, limit: float) -> TruncatedTails:
    """The isotropic Gaussian whose length has this lower quartile, truncated at the limit."""
    tail = StudentT(lower_quartile / LOWER_QUARTILE_OF_THREE)
    return TruncatedTails(tail, tail, limit)
