"""The level at which a method succeeds half the time, and bounds that need no curve but that success falls.

The estimate is where the likeliest falling rates (isotonic regression) cross one half, read along the logarithm of the
level. Level 0 has no logarithm and is left out of it.

Its bounds are the level up to which success is surely over one half, and the one from which it is surely under it. They
are found by exact binomial tests in a fixed order, from each end of the levels to the first one that does not reject:
each is wrong in at most 2.5 %.
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
    """Where success is one half; levels in mm, as in records."""

    condition: Condition
    """At the level 0, which stands for all."""
    smallest: float
    """Of the levels tried that are above 0."""
    largest: float
    trials: int
    """Results over all levels."""
    noise_mm: float | None
    """The estimate; None where it lies outside the levels tried."""
    beyond: str | None
    """On which side of them it lies, `below` or `above`."""
    surely_over: float | None
    """The largest level up to which success is over one half whatever the curve, as long as it falls; None if none."""
    surely_under: float | None
    """The smallest level from which success is under one half whatever the curve; None if none."""

    @property
    def text(self) -> str:
        """`1.31`, `> 4`, `< 0.1`."""
        if self.noise_mm is not None:
            return f"{self.noise_mm:.3g}"
        return f"> {self.largest:g}" if self.beyond == "above" else f"< {self.smallest:g}"

    @property
    def sure_text(self) -> str:
        """`1 to 2`, `> 4`, `< 0.1`; `any` where neither bound is known."""
        if self.surely_over is None:
            return "any" if self.surely_under is None else f"< {self.surely_under:g}"
        over = f"{self.surely_over:g}"
        return f"> {over}" if self.surely_under is None else f"{over} to {self.surely_under:g}"


def half_levels(cells: Iterable[ConditionResult]) -> tuple[HalfLevel, ...]:
    """One per method and setting that has two levels or more, in the order of the cells; the oracle meets no level.

    Where poses are drawn a level is as many degrees as mm; cells with another pair of the two are on no curve.
    """
    curves = group_by((c.curve, c) for c in cells if c.trials and _is_usual(c) and not knows_truth(c.method))
    return tuple(half_level(condition, own) for condition, own in curves.items() if len(own) > 1)


def half_level(condition: Condition, cells: Sequence[ConditionResult]) -> HalfLevel:
    """Where the rates of cells at rising levels cross one half."""
    from scipy.optimize import isotonic_regression

    levels = np.array([c.noise_mm for c in cells])
    right = np.array([c.successes for c in cells])
    trials = np.array([c.trials for c in cells])
    over, under = map(int, sure(right, trials))
    met = levels > 0
    x = np.log(levels[met])
    falling = isotonic_regression((right / trials)[met], weights=trials[met], increasing=False).x
    beyond = "below" if falling[0] < 0.5 else "above" if falling[-1] > 0.5 else None
    return HalfLevel(
        condition=condition,
        smallest=float(levels[met][0]),
        largest=float(levels[-1]),
        trials=int(trials.sum()),
        noise_mm=None if beyond else float(np.exp(np.interp(0.5, falling[::-1], x[::-1]))),
        beyond=beyond,
        surely_over=float(levels[over - 1]) if over else None,
        surely_under=float(levels[-under]) if under else None,
    )


def sure(right: Array, trials: Array) -> tuple[Array, Array]:
    """How many levels, counted from the smallest, are surely over one half, and how many, from the largest, under it.

    Args:
        right, trials: (..., k) successes and trials at the levels.

    Returns:
        (...) and (...).
    """
    from scipy.stats import binom

    error = (1.0 - CONFIDENCE) / 2.0
    over = binom.sf(right - 1, trials, 0.5) <= error
    under = binom.cdf(right, trials, 0.5) <= error
    return np.cumprod(over, axis=-1).sum(axis=-1), np.cumprod(under[..., ::-1], axis=-1).sum(axis=-1)


def _is_usual(cell: ConditionResult) -> bool:
    return cell.noise_deg == (0.0 if cell.noise == DEPTH_CAMERA else cell.noise_mm)
