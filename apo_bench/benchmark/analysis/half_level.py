"""The noise level at which a method succeeds half the time, with bounds that assume only that success falls.

The estimate is the level, interpolated on a logarithmic scale, at which the isotonic regression of the rates crosses
one half. Level 0 has no logarithm and is left out.

One bound is the largest level at which success is surely over one half, the other the smallest level at which it is
surely under one half. Exact binomial tests run in a fixed order, from each end of the levels to the first test that
does not reject. Each bound is wrong with a probability of at most 2.5 %.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.benchmark.analysis.condition import Condition
from apo_bench.benchmark.analysis.rates import CONFIDENCE, ConditionResult
from apo_bench.geometry import Array
from apo_bench.io import group_by
from apo_bench.records import DEPTH_CAMERA, knows_truth


@final
@dataclass(frozen=True)
class HalfLevel:
    """The noise level at which success is one half; levels are in mm, as in records."""

    condition: Condition
    """The curve: the condition at level 0, which stands for all levels."""
    smallest: float
    """Smallest level above 0 that was tried."""
    largest: float  # largest level that was tried
    trials: int
    """Number of trials over all levels."""
    noise_mm: float | None
    """The estimate; None if it lies outside the levels tried."""
    beyond: str | None
    """The side on which it lies outside: `below` or `above`; None if inside."""
    surely_over: float | None
    """Largest level at which success is over one half for any falling curve; None if there is none."""
    surely_under: float | None
    """Smallest level from which success is under one half for any falling curve; None if there is none."""

    @property
    def text(self) -> str:
        """The estimate as text: `1.31`, `> 4`, `< 0.1`."""
        if self.noise_mm is not None:
            return f"{self.noise_mm:.3g}"
        return f"> {self.largest:g}" if self.beyond == "above" else f"< {self.smallest:g}"

    @property
    def sure_text(self) -> str:
        """The bounds as text: `1 to 2`, `> 4`, `< 0.1`; `any` if neither bound is known."""
        if self.surely_over is None:
            return "any" if self.surely_under is None else f"< {self.surely_under:g}"
        over = f"{self.surely_over:g}"
        return f"> {over}" if self.surely_under is None else f"{over} to {self.surely_under:g}"


def estimate_half_levels(cells: Iterable[ConditionResult]) -> tuple[HalfLevel, ...]:
    """MeanEstimate one half level per method and setting with at least two levels, in the order of the conditions.

    The oracle has none, since noise does not affect it. On a curve a level has equal numbers of mm and degrees (no
    degrees with the depth camera); other conditions are left out.
    """
    curves = group_by((c.curve, c) for c in cells if c.trials and _is_usual(c) and not knows_truth(c.method))
    return tuple(estimate_half_level(condition, own) for condition, own in curves.items() if len(own) > 1)


def estimate_half_level(condition: Condition, cells: Sequence[ConditionResult]) -> HalfLevel:
    """MeanEstimate the level at which success crosses one half from the results at rising levels."""
    from scipy.optimize import isotonic_regression

    levels = np.array([c.noise_mm for c in cells])
    right = np.array([c.successes for c in cells])
    trials = np.array([c.trials for c in cells])
    over, under = map(int, count_sure_levels(right, trials))
    met = levels > 0  # levels that have a logarithm
    x = np.log(levels[met])
    falling = isotonic_regression((right / trials)[met], weights=trials[met], increasing=False).x
    beyond = "below" if falling[0] < 0.5 else "above" if falling[-1] > 0.5 else None
    return HalfLevel(
        condition=condition,
        smallest=float(levels[met][0]),
        largest=float(levels[-1]),
        trials=int(trials.sum()),
        # np.interp needs rising abscissas, so both arrays are reversed
        noise_mm=None if beyond else float(np.exp(np.interp(0.5, falling[::-1], x[::-1]))),
        beyond=beyond,
        surely_over=float(levels[over - 1]) if over else None,  # `over` levels from the smallest on
        surely_under=float(levels[-under]) if under else None,
    )


def count_sure_levels(right: Array, trials: Array) -> tuple[Array, Array]:
    """Count the levels, from the smallest on, with success surely over one half, and from the largest on, under it.

    Args:
        right, trials: Successes and trials at the levels, (..., k).

    Returns:
        The two counts, (...) and (...).
    """
    from scipy.stats import binom

    error = (1.0 - CONFIDENCE) / 2.0  # each bound is one-sided
    over = binom.sf(right - 1, trials, 0.5) <= error
    under = binom.cdf(right, trials, 0.5) <= error
    # the cumulative product ends a run of rejections at the first test that does not reject
    return np.cumprod(over, axis=-1).sum(axis=-1), np.cumprod(under[..., ::-1], axis=-1).sum(axis=-1)


def _is_usual(cell: ConditionResult) -> bool:
    """Return whether a condition lies on a curve: as many degrees as mm, or none with the depth camera."""
    return cell.noise_deg == (0.0 if cell.noise == DEPTH_CAMERA else cell.noise_mm)
