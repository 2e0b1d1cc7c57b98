"""The area under success over level, from 0 to 1, and how the areas of two methods differ over the same seeds.

The axis is the logarithm of the level, from the smallest level above 0 to the largest, scaled to the length 1: an area
is the success of a trial whose level is drawn evenly on that axis. Between levels success is a straight line
(trapezoids). Level 0 has no place on it and is left out. Every seed that has a result at each of the levels gives one
area.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.statistics.levels.bounded import mean_interval
from apo_bench.statistics.levels.curve import Curve, CurveSetting
from apo_bench.statistics.paired import REFERENCES
from apo_bench.statistics.rates import Interval


@final
@dataclass(frozen=True)
class Area:
    """Mean success over the logarithm of the level."""

    setting: CurveSetting
    levels: tuple[float, ...]
    seeds: int
    """The seeds that have a result at every level."""
    area: float | None
    """The mean over seeds; None without one."""
    interval: Interval
    """At 95 %."""


@final
@dataclass(frozen=True)
class AreaDifference:
    """The area of a method minus that of another one, seed by seed."""

    setting: CurveSetting
    """Of the method."""
    reference: str
    levels: tuple[float, ...]
    """The levels that both have."""
    seeds: int
    """The seeds that have a result of both at every level."""
    difference: float | None
    interval: Interval
    """At 95 %."""


def areas(found: Iterable[Curve]) -> tuple[Area, ...]:
    """One per curve that has two levels above 0 or more, in the same order."""
    return tuple(map(area, filter(_has_area, found)))


def area(curve: Curve) -> Area:
    """The area under one curve."""
    levels = curve.levels[curve.levels > 0]
    by_seed = _areas_by_seed(curve, levels)
    found = by_seed[~np.isnan(by_seed)]
    return Area(curve.setting, tuple(levels.tolist()), len(found), _mean(found), mean_interval(found))


def area_differences(found: Iterable[Curve], references: Sequence[str] = REFERENCES) -> tuple[AreaDifference, ...]:
    """Every curve against every reference, in the same order."""
    known = {curve.setting: curve for curve in filter(_has_area, found)}
    pairs = [
        (curve, known[curve.setting.reference(reference)], reference)
        for curve in known.values()
        for reference in references
        if curve.setting.method != reference and curve.setting.reference(reference) in known
    ]
    return tuple(_difference(*pair) for pair in pairs if len(_common(*pair[:2])) > 1)


def weights(levels: Array) -> Array:
    """(k,) of the trapezoids over the logarithm of rising levels above 0; they add up to 1."""
    widths = np.diff(np.log(levels))
    return np.asarray((np.r_[widths, 0.0] + np.r_[0.0, widths]) / (2.0 * widths.sum()))


def reach(apart: Array, levels: Array) -> Array:
    """(...) how far apart the two areas of a seed that was not seen may be: as far as any that was, (..., n), and at
    least as far as one level makes. Bounds of -1 and 1 would be true too, but cover in 99 of 100."""
    return np.asarray(np.maximum(np.abs(apart).max(axis=-1), weights(levels).max()))


def _areas_by_seed(curve: Curve, levels: Array) -> Array:
    """(n,) NaN for a seed without a result somewhere; rounded, so that sums in another order are the same number."""
    return np.asarray(np.round(curve.at(levels) @ weights(levels), 12))


def _has_area(curve: Curve) -> bool:
    return int((curve.levels > 0).sum()) > 1


def _common(a: Curve, b: Curve) -> Array:
    return np.array(sorted({x for x in a.levels.tolist() if x > 0} & set(b.levels.tolist())))


def _difference(ours: Curve, theirs: Curve, reference: str) -> AreaDifference:
    levels = _common(ours, theirs)
    a, b = (dict(zip(c.seeds, _areas_by_seed(c, levels).tolist(), strict=True)) for c in (ours, theirs))
    apart = np.round([a[seed] - b[seed] for seed in sorted(set(a) & set(b))], 12)
    apart = apart[~np.isnan(apart)]
    most = float(reach(apart, levels)) if len(apart) else 1.0
    between = mean_interval(apart, -most, most)
    return AreaDifference(ours.setting, reference, tuple(levels.tolist()), len(apart), _mean(apart), between)


def _mean(x: Array) -> float | None:
    return float(np.mean(x)) if len(x) else None
