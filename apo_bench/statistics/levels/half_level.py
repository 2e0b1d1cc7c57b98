"""The level at which a method succeeds half the time, with an interval that may reach beyond the levels tried.

The estimate and its interval come from curves that fall with the logarithm of the level, of any steepness, with or
without lapses, lopsided or not (`falling.py`): where success falls from all to nothing between two levels, the interval
is most of what lies between them, as nothing is known about where. Level 0 has no logarithm and is left out.

Beside it stand bounds that need no curve but that success falls: the level up to which it is surely over one half, and
the one from which it is surely under it. They are found by exact binomial tests in a fixed order, from each end of the
levels to the first one that does not reject: each is wrong in at most 2.5 %.

All that a report says in numbers about who succeeds, in one call.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.geometry import Array
from apo_bench.records import Row
from apo_bench.statistics.levels.curves import (
    Area,
    AreaDifference,
    Curve,
    CurveSetting,
    area_differences,
    areas,
    curves,
)
from apo_bench.statistics.levels.falling import profile
from apo_bench.statistics.over_seeds import threshold
from apo_bench.statistics.paired import REFERENCES, Paired, paired
from apo_bench.statistics.rates import CONFIDENCE, Cell, tally

_LIKELIEST = 0.05
"""Half levels that are no more surprising than this are as good as the likeliest; their middle is the estimate."""


@final
@dataclass(frozen=True)
class HalfLevel:
    """Where success is one half; levels in mm, as in rows."""

    setting: CurveSetting
    smallest: float
    """Of the levels tried that are above 0."""
    largest: float
    trials: int
    """Results over all levels."""
    level: float | None
    """The estimate; None where it lies outside the levels tried."""
    beyond: str | None
    """On which side of them it lies, `below` or `above`; `none` if success is under one half even at level 0."""
    low: float | None
    """The 95 % interval; None where it reaches below the smallest level."""
    high: float | None
    """None where it reaches above the largest level."""
    surely_over: float | None
    """The largest level up to which success is over one half whatever the curve, as long as it falls; None if none."""
    surely_under: float | None
    """The smallest level from which success is under one half whatever the curve; None if none."""

    @property
    def text(self) -> str:
        """`1.31`, `> 4`, `< 0.1`, `none`."""
        if self.level is not None:
            return f"{self.level:.3g}"
        if self.beyond == "above":
            return f"> {self.largest:g}"
        return f"< {self.smallest:g}" if self.beyond == "below" else "none"

    @property
    def interval_text(self) -> str:
        """`1.1 to 1.6`, `> 3.2`, `< 0.2`; `any` where the interval reaches beyond both ends."""
        return _range(self.low, self.high)

    @property
    def sure_text(self) -> str:
        """`1 to 2`, `> 4`: between the level up to which success is surely over one half and that from which it is
        surely under it; `none` if it is surely under it at level 0."""
        return _range(self.surely_over, self.surely_under)


def half_levels(curves: Iterable[Curve]) -> tuple[HalfLevel, ...]:
    """One per curve, in the same order."""
    return tuple(map(half_level, curves))


def half_level(curve: Curve) -> HalfLevel:
    """Where a curve crosses one half."""
    levels = curve.levels
    known = ~np.isnan(curve.success)
    right = np.nansum(curve.success, axis=0)
    over, under = map(int, sure(right, known.sum(axis=0)))
    met = levels > 0
    level, beyond, low, high = _profiled(levels[met], curve.success[:, met][known[:, met].any(axis=1)])
    if beyond == "below" and not met[0] and 2 * right[0] < known[:, 0].sum():
        beyond = "none"
    return HalfLevel(
        setting=curve.setting,
        smallest=float(levels[met][0]),
        largest=float(levels[-1]),
        trials=int(known.sum()),
        level=level,
        beyond=beyond,
        low=low,
        high=high,
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


def _profiled(levels: Array, success: Array) -> tuple[float | None, str | None, float | None, float | None]:
    """Estimate, side on which it lies beyond the levels, and both ends of the interval; see `HalfLevel`."""
    x = np.log(levels)
    h, surprise = profile(x, success)
    most = threshold(len(success))
    # several half levels may be as likely as one another (between two levels of all and nothing): their middle
    middle = float(np.median(h[surprise <= _LIKELIEST]))
    beyond = "below" if middle < x[0] else "above" if middle > x[-1] else None
    believed = np.flatnonzero(surprise <= most)
    low = min(_end(h, surprise, most, int(believed[0]), -1), float(x[-1]))
    high = max(_end(h, surprise, most, int(believed[-1]), 1), float(x[0]))
    return (
        float(np.exp(middle)) if beyond is None else None,
        beyond,
        float(np.exp(low)) if low > x[0] else None,
        float(np.exp(high)) if high < x[-1] else None,
    )


def _end(h: Array, surprise: Array, most: float, k: int, step: int) -> float:
    """Where between a half level that is believed and the next, which is not, the surprise passes its threshold."""
    if not 0 <= k + step < len(h):
        return step * float("inf")
    # the surprise is taken for straight between the two
    return float(np.interp(most, surprise[[k, k + step]], h[[k, k + step]]))


def _range(low: float | None, high: float | None) -> str:
    if low is not None and high is not None:
        return f"{low:.3g} to {high:.3g}"
    if high is not None:
        return f"< {high:.3g}" if high > 0 else "none"
    return "any" if low is None else f"> {low:.3g}"


@final
@dataclass(frozen=True)
class Summary:
    """Each sorted as `tally` sorts; nothing of it depends on chance or on the order of rows."""

    cells: tuple[Cell, ...]
    pairs: tuple[Paired, ...]
    half_levels: tuple[HalfLevel, ...]
    areas: tuple[Area, ...]
    area_differences: tuple[AreaDifference, ...]


def summary(rows: Iterable[Row], references: Sequence[str] = REFERENCES) -> Summary:
    """Rates, pairs, half levels and areas of rows.

    Args:
        references: The methods that every other one is compared with.

    Raises:
        InputError: A trial is there twice.
    """
    rows = list(rows)
    over_levels = curves(rows)
    return Summary(
        cells=tally(rows),
        pairs=paired(rows, references),
        half_levels=half_levels(over_levels),
        areas=areas(over_levels),
        area_differences=area_differences(over_levels, references),
    )
