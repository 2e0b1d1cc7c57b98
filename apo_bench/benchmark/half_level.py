"""The level at which a method succeeds half the time, with an interval that may reach beyond the levels tried.

Success is taken to fall with the level. Between two levels it is read off a straight line over the logarithm of the
level (over the level itself next to level 0), after the levels were made to fall by isotonic regression. A level is in
the interval unless success there, along that line, is surprising at 1/2 (`bounded.py`). Both levels of a line come from
the same seeds, so what a seed does at one and at the other may be as alike as it likes.

No curve of a given shape is fitted: some methods fall from all to nothing between two levels, others have lapses that
do not depend on the level. The line is a convention, though, so there are also bounds that need no line: the level up
to which success is surely over one half, and the one from which it is surely under it. They are found by exact binomial
tests in a fixed order, from each end of the levels to the first one that does not reject: each is wrong in at most
2.5 %.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.benchmark.bounded import surprise, threshold
from apo_bench.benchmark.curve import Curve, Setting
from apo_bench.benchmark.statistics import CONFIDENCE
from apo_bench.geometry.arrays import Array

PARTS = 32
"""Into which a line is cut to find where the interval ends, again and again."""
AGAIN = 3


@final
@dataclass(frozen=True)
class HalfLevel:
    """Where success is one half; levels in mm, as in rows."""

    setting: Setting
    smallest: float
    """Of the levels tried."""
    largest: float
    trials: int
    """Results over all levels."""
    level: float | None
    """The estimate; None where it lies outside the levels tried."""
    beyond: str | None
    """On which side of them it lies, `below` or `above`; None inside."""
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
        """`1.31`, `> 4`, `< 0.1`; `none` where even level 0 is too much."""
        if self.level is not None:
            return f"{self.level:.3g}"
        if self.beyond == "above":
            return f"> {self.largest:g}"
        return f"< {self.smallest:g}" if self.smallest > 0 else "none"

    @property
    def interval_text(self) -> str:
        """`1.1 to 1.6`, `> 3.2`, `< 0.2`; `any` where the interval reaches beyond both ends."""
        return _range(self.low, self.high)

    @property
    def sure_text(self) -> str:
        """`1 to 2`, `> 4`: between the level up to which success is surely over one half and that from which it is
        surely under it."""
        return _range(self.surely_over, self.surely_under)


def half_levels(found: Iterable[Curve]) -> tuple[HalfLevel, ...]:
    """One per curve, in the same order."""
    return tuple(map(half_level, found))


def half_level(curve: Curve) -> HalfLevel:
    """Where a curve crosses one half."""
    levels, known = curve.levels, ~np.isnan(curve.success)
    level, beyond = _estimate(levels, np.nanmean(curve.success, axis=0), known.sum(axis=0))
    inside = _accepted(levels, segments(curve.success))
    below, above = (_may_lie_beyond(curve.success[known[:, k], k], up) for k, up in ((0, False), (-1, True)))
    if level is not None:
        inside = (min(*inside, level), max(*inside, level)) if inside else (level, level)
    smallest, largest = float(levels[0]), float(levels[-1])
    over, under = sure(levels, np.nansum(curve.success, axis=0), known.sum(axis=0))
    return HalfLevel(
        setting=curve.setting,
        smallest=smallest,
        largest=largest,
        trials=int(known.sum()),
        level=level,
        beyond=beyond,
        low=None if below else inside[0] if inside else largest,
        high=None if above else inside[1] if inside else smallest,
        surely_over=over,
        surely_under=under,
    )


def sure(levels: Array, right: Array, trials: Array) -> tuple[float | None, float | None]:
    """The last level up to which success is surely over one half, and the first from which it is surely under it.

    Args:
        right, trials: (k,) successes and trials at the levels.
    """
    from scipy.stats import binom

    error = (1.0 - CONFIDENCE) / 2.0
    over = binom.sf(right - 1, trials, 0.5) <= error
    under = binom.cdf(right, trials, 0.5) <= error
    up, down = int(np.argmin([*over, False])), int(np.argmin([*under[::-1], False]))
    return (float(levels[up - 1]) if up else None), (float(levels[-down]) if down else None)


def between(a: Array | float, b: Array | float, w: Array | float) -> Array:
    """The level at a part w of the way from a to b: along the logarithm, along the level itself from 0."""
    a, b, w = np.asarray(a, dtype=float), np.asarray(b, dtype=float), np.asarray(w, dtype=float)
    along_log = np.where(a > 0, a, 1.0) * (b / np.where(a > 0, a, 1.0)) ** w
    return np.where(a > 0, along_log, w * b)


def segments(success: Array) -> Array:
    """(..., n, k) results -> (..., k - 1, 4) how many seeds are right at neither, the second, the first, both of two
    neighbouring levels."""
    kind = 2 * success[..., :-1] + success[..., 1:]
    return np.stack([(kind == i).sum(axis=-2) for i in range(4)], axis=-1)


def surprise_at_half(counts: Array, w: Array) -> Array:
    """How surprising a success of one half is, a part w of the way along a segment.

    Args:
        counts: (..., 4) as of `segments`.
        w: (...).
    """
    values = np.stack([np.zeros_like(w), w, 1.0 - w, np.ones_like(w)], axis=-1)
    return surprise(values, counts, 0.5)


def _estimate(levels: Array, rates: Array, trials: Array) -> tuple[float | None, str | None]:
    from scipy.optimize import isotonic_regression

    fit = np.round(isotonic_regression(rates, weights=trials, increasing=False).x, 12)
    if fit[0] < 0.5:
        return None, "below"
    if fit[-1] > 0.5:
        return None, "above"
    last, first = int(np.flatnonzero(fit >= 0.5)[-1]), int(np.flatnonzero(fit <= 0.5)[0])
    ends = [_crossing(levels, fit, last) if last + 1 < len(fit) else float(levels[-1])]
    ends.append(_crossing(levels, fit, first - 1) if first > 0 else float(levels[0]))
    return float(between(min(ends), max(ends), 0.5)), None


def _crossing(levels: Array, fit: Array, k: int) -> float:
    w = (fit[k] - 0.5) / (fit[k] - fit[k + 1])
    return float(between(levels[k], levels[k + 1], w))


def _accepted(levels: Array, counts: Array) -> tuple[float, float] | None:
    """The first and the last level between the smallest and the largest at which one half is not too surprising."""
    found = [_ends(counts[k]) if counts[k].any() else (0.0, 1.0) for k in range(len(counts))]
    at = [float(between(levels[k], levels[k + 1], w)) for k, ends in enumerate(found) if ends is not None for w in ends]
    return (min(at), max(at)) if at else None


def _ends(counts: Array) -> tuple[float, float] | None:
    w = np.linspace(0.0, 1.0, PARTS + 1)
    good = np.flatnonzero(surprise_at_half(counts, w) <= threshold(int(counts.sum())))
    if not len(good):
        return None
    return _refined(counts, w[good[0]], -1.0 / PARTS), _refined(counts, w[good[-1]], 1.0 / PARTS)


def _refined(counts: Array, accepted: float, step: float) -> float:
    """From an accepted place towards a refused one, a step away."""
    most = threshold(int(counts.sum()))
    for _ in range(AGAIN):
        w = accepted + step * np.linspace(0.0, 1.0, PARTS + 1)
        w = w[(w >= 0.0) & (w <= 1.0)]
        good = surprise_at_half(counts, w) <= most
        accepted, step = float(w[np.flatnonzero(good)[-1]]), step / PARTS
    return accepted


def _may_lie_beyond(success: Array, above: bool) -> bool:
    """Whether success at the last level may still be over one half, or at the first already under it."""
    right = int(success.sum())
    wrong = len(success) - right
    if (right >= wrong) if above else (right <= wrong):
        return True
    return bool(surprise(np.array([0.0, 1.0]), np.array([wrong, right]), 0.5) <= threshold(len(success)))


def _range(low: float | None, high: float | None) -> str:
    if low is not None and high is not None:
        return f"{low:.3g} to {high:.3g}"
    if high is not None:
        return f"< {high:.3g}" if high > 0 else "none"
    return "any" if low is None else f"> {low:.3g}"
