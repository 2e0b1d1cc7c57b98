"""Fit a noise model to residuals of a pose estimator: tails by maximum likelihood, rates by counting."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry import Array
from apo_bench.perception.observation.models import (
    INLIER_MM,
    LEAST_FREEDOM,
    SMALLEST_SCALE,
    TURNED_DEG,
    MeasuredNoise,
    Residuals,
    TruncatedTails,
    compute_log_density_across,
    compute_log_density_along,
    unpack_tails,
)

_FEWEST = 30
"""Least number of errors for a fit of four parameters."""
_CHANCE = 1.358
"""95 % quantile of the Kolmogorov distribution."""
_BANDS = 5
"""Number of bands of scores, with equally many estimates each."""
PERCENTILES = (25, 50, 75, 90, 95)
"""Percentiles at which measured and fitted errors are compared."""


class GoodnessOfFit(NamedTuple):
    """Goodness of fit of one error component."""

    name: str
    unit: str
    observed: Array
    """(5,), measured percentiles, see `PERCENTILES`."""
    fitted: Array
    """(5,), percentiles of the fitted distribution."""
    distance: float
    """Kolmogorov-Smirnov distance: the largest difference of the two cumulative distributions."""
    by_chance: float
    """95 % quantile of that distance for independent errors that follow the fitted distribution."""


class ScoreBand(NamedTuple):
    """Estimates with similar confidence scores."""

    least: float
    """Lowest score in the band."""
    outliers: float
    """Fraction of outliers, 0 to 1."""


def fit_noise(residuals: Residuals, source: str) -> MeasuredNoise:
    """Fit a noise model to residuals by maximum likelihood.

    Position errors come from upright inliers, rotation errors from inliers whose rotation is unambiguous. Errors are
    measured from the truth, not from their mean: a bias of the estimator enlarges them, and the drawn noise has none.

    Args:
        source: Description of the data, for the noise file.

    Raises:
        InputError: There are too few inliers, or nearly all are exact.
    """
    found = residuals.is_estimated
    upright = residuals.is_upright
    known = residuals.has_rotation_error
    near = f"{INLIER_MM:g} mm and {TURNED_DEG:g} deg"
    for kept, limit in ((upright, near), (known, f"{near} and do not look alike when turned by any angle")):
        if kept.sum() < _FEWEST:
            raise InputError(
                f"{int(kept.sum())} of {len(kept)} parts have an estimate within {limit}; at least {_FEWEST} are "
                "needed for a fit, so give more images, or the truth of the same ones."
            )
    far = residuals.distance_from_truth_mm[found & ~residuals.is_inlier]
    return MeasuredNoise(
        source=source,
        shift_mm=fit_split(residuals.shift_mm[upright], INLIER_MM, "places"),
        turn_deg=fit_split(residuals.turn_deg[known], TURNED_DEG, "rotations"),
        missed=float(1.0 - found.mean()),
        outliers=float(1.0 - residuals.is_inlier.sum() / found.sum()),
        farthest_mm=INLIER_MM * float(np.exp(2.0 * np.log(far / INLIER_MM).mean())) if len(far) else 2.0 * INLIER_MM,
    )


def fit_split(errors: Array, limit: float, name: str = "errors") -> TruncatedTails:
    """Fit scales and degrees of freedom to errors by maximum likelihood.

    The likelihood is that of the distribution truncated at the limit, so the cut does not shorten the fitted tails.

    Args:
        errors: (n, 3), across (two components) and along the camera ray, all within the limit.
        limit: Truncation of the distribution, in the unit of the errors.
        name: Name of the errors in error messages.
    """
    from scipy.optimize import minimize

    r = np.linalg.norm(errors[:, :2], axis=1)
    x = errors[:, 2]
    if max(np.median(r), np.median(np.abs(x))) <= SMALLEST_SCALE * limit:
        raise InputError(
            f"the {name} that were estimated are the true ones, or nearly: half of them are off by less than "
            f"{SMALLEST_SCALE * limit:g}; give the estimates of an estimator."
        )

    def surprise(at: Array) -> float:
        # Mean negative log-likelihood of the truncated distribution.
        split = unpack_tails(at, limit)
        seen = compute_log_density_across(split.across, r).mean() + compute_log_density_along(split.along, x).mean()
        return float(np.log(max(split.probability_inside, 1e-300)) - seen)

    # Medians of a Gaussian: 1.18 s of a length across (Rayleigh), 0.675 s of a size along.
    low = np.log(SMALLEST_SCALE * limit)
    high = np.log(limit)
    start = [np.log(max(size, SMALLEST_SCALE * limit)) for size in (np.median(r) / 1.18, np.median(np.abs(x)) / 0.675)]
    best = minimize(
        surprise,
        [start[0], 0.15, start[1], 0.15],
        bounds=[(low, high), (0.0, 1.0 / LEAST_FREEDOM)] * 2,
        method="L-BFGS-B",
        options={"ftol": 1e-13, "gtol": 1e-7},
    )
    return unpack_tails(best.x, limit)


def count_outliers_by_score(residuals: Residuals) -> tuple[ScoreBand, ...]:
    """Outlier rates of `_BANDS` equally large bands of estimates, lowest scores first.

    Empty if there are too few scores or bands begin with equal scores.
    """
    found = residuals.is_estimated & np.isfinite(residuals.score)
    order = np.argsort(residuals.score[found], kind="stable")
    if len(order) < _BANDS * _FEWEST:
        return ()
    score = residuals.score[found][order]
    inlier = residuals.is_inlier[found][order]
    each = [
        ScoreBand(float(s[0]), 1.0 - float(i.mean()))
        for s, i in zip(*(np.array_split(x, _BANDS) for x in (score, inlier)), strict=True)
    ]
    return tuple(each) if len({band.least for band in each}) == _BANDS else ()


def compute_goodness_of_fit(residuals: Residuals, measured: MeasuredNoise) -> tuple[GoodnessOfFit, ...]:
    """Goodness of fit of the four fitted distributions: position and rotation, across and along the ray."""
    shift = measured.shift_mm
    turn = measured.turn_deg
    turned = residuals.turn_deg[residuals.has_rotation_error]
    tilt = np.linalg.norm(turned[:, :2], axis=1)
    about = np.abs(turned[:, 2])
    return (
        _compare_distribution(
            "across the ray", "mm", residuals.across_mm[residuals.is_upright], shift.cdf_across, shift.limit
        ),
        _compare_distribution(
            "along the ray", "mm", residuals.along_mm[residuals.is_upright], shift.cdf_along, shift.limit
        ),
        _compare_distribution("tilt", "deg", tilt, turn.cdf_across, turn.limit),
        _compare_distribution("turn about the ray", "deg", about, turn.cdf_along, turn.limit),
    )


def _compare_distribution(
    name: str, unit: str, sizes: Array, cdf: Callable[[Array], Array], limit: float
) -> GoodnessOfFit:
    """Compare measured sizes (n,) with a fitted cumulative distribution up to the limit."""
    grid = limit * np.linspace(0.0, 1.0, 2001) ** 2
    chance = np.maximum.accumulate(cdf(grid))
    ordered = np.sort(sizes)
    n = len(sizes)
    at = np.interp(ordered, grid, chance)
    # The empirical distribution steps from (i - 1) / n to i / n at the i-th size; the distance is largest at a step.
    step = np.arange(n + 1) / n
    return GoodnessOfFit(
        name=name,
        unit=unit,
        observed=np.percentile(sizes, PERCENTILES),
        fitted=np.interp(np.array(PERCENTILES) / 100.0, chance, grid),
        distance=float(max((step[1:] - at).max(), (at - step[:-1]).max())),
        by_chance=_CHANCE / float(np.sqrt(n)),
    )
