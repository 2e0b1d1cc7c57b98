"""Success over level: what a method does at the same seeds as the noise grows, and the area below.

The area is from 0 to 1. Its axis is the logarithm of the level, from the smallest level above 0 to the largest, scaled
to the length 1: an area is the success of a trial whose level is drawn evenly on that axis. Between levels success is a
straight line (trapezoids). Level 0 has no place on it and is left out. Every seed that has a result at each of the
levels gives one area.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple, final

import numpy as np

from apo_bench.geometry import Array
from apo_bench.records import RANGE, Row, TrialSettings, knows_truth
from apo_bench.statistics.over_seeds import mean_interval
from apo_bench.statistics.paired import REFERENCES, place_of_reference
from apo_bench.statistics.rates import Interval, by_place, order


class CurveSetting(NamedTuple):
    """What the trials of a curve have in common: all but level and seed."""

    scenario: str
    clearance_mm: float
    noise: str
    relations: str
    careless: float
    method: str
    grasp: str = "friction"
    fidelity: str = "full"
    looks: int = 0
    robot_error: str = "none"
    wrench: str = TrialSettings.wrench
    stated_error: str = TrialSettings.stated_error
    abstain: float = 0.0


@final
@dataclass(frozen=True, eq=False)
class Curve:
    """The results of one setting, one row per seed and one column per level."""

    setting: CurveSetting
    levels: Array
    """(k,), rising, in mm (and the same number of degrees where poses are drawn)."""
    seeds: tuple[int, ...]
    success: Array
    """(n, k): 1 right, 0 wrong, NaN where there is no result."""


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


def curves(rows: Iterable[Row]) -> tuple[Curve, ...]:
    """One per setting that has two levels or more, sorted as `tally` sorts; the oracle meets no level.

    Where poses are drawn a level is as many degrees as mm; trials with another pair of the two are on no curve.

    Raises:
        InputError: A trial is there twice.
    """
    groups: dict[CurveSetting, dict[float, dict[int, bool]]] = {}
    for place, seeds in sorted(by_place(rows).items(), key=lambda cell: order(cell[0])):
        results = {seed: row["success"] for seed, row in seeds.items() if row["success"] is not None}
        if (
            results
            and (place.level_deg == (0.0 if place.noise == RANGE else place.level))
            and not knows_truth(place.method)
        ):
            setting = CurveSetting(*(getattr(place, name) for name in CurveSetting._fields))
            groups.setdefault(setting, {})[place.level] = results
    return tuple(_curve(setting, by_level) for setting, by_level in groups.items() if len(by_level) > 1)


def areas(curves: Iterable[Curve]) -> tuple[Area, ...]:
    """One per curve that has two levels above 0 or more, in the same order."""
    return tuple(map(area, filter(_has_area, curves)))


def area(curve: Curve) -> Area:
    """The area under one curve."""
    levels = curve.levels[curve.levels > 0]
    by_seed = _areas_by_seed(curve, levels)
    known = by_seed[~np.isnan(by_seed)]
    return Area(curve.setting, tuple(levels.tolist()), len(known), _mean(known), mean_interval(known))


def area_differences(curves: Iterable[Curve], references: Sequence[str] = REFERENCES) -> tuple[AreaDifference, ...]:
    """Every curve against every reference, in the same order."""
    known = {curve.setting: curve for curve in filter(_has_area, curves)}
    return tuple(
        _difference(curve, other, reference)
        for curve, reference in product(known.values(), references)
        if (other := known.get(place_of_reference(curve.setting, reference))) is not None
        and curve.setting.method != reference
        and len(_common(curve, other)) > 1
    )


def weights(levels: Array) -> Array:
    """(k,) of the trapezoids over the logarithm of rising levels above 0; they add up to 1."""
    widths = np.diff(np.log(levels))
    # each level has half of the interval below it and half of the one above
    return np.asarray((np.r_[widths, 0.0] + np.r_[0.0, widths]) / (2.0 * widths.sum()))


def reach(apart: Array, levels: Array) -> Array:
    """(...) how far apart the two areas of a seed that was not seen may be: as far as any that was, (..., n), and at
    least as far as one level makes. Bounds of -1 and 1 would be true too, but cover in 99 of 100."""
    return np.asarray(np.maximum(np.abs(apart).max(axis=-1), weights(levels).max()))


def _curve(setting: CurveSetting, by_level: Mapping[float, Mapping[int, bool]]) -> Curve:
    levels = np.array(sorted(by_level))
    seeds = tuple(sorted(set().union(*by_level.values())))
    columns = [[float(by_level[level].get(seed, np.nan)) for seed in seeds] for level in levels.tolist()]
    return Curve(setting, levels, seeds, np.array(columns).T)


def _areas_by_seed(curve: Curve, levels: Array) -> Array:
    """(n,) NaN for a seed without a result somewhere; rounded, so that sums in another order are the same number."""
    return np.asarray(np.round(curve.success[:, np.searchsorted(curve.levels, levels)] @ weights(levels), 12))


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
    return AreaDifference(
        ours.setting, reference, tuple(levels.tolist()), len(apart), _mean(apart), mean_interval(apart, -most, most)
    )


def _mean(x: Array) -> float | None:
    return float(np.mean(x)) if len(x) else None
