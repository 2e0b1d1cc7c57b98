"""Success over level: what a method does at the same seeds as the noise grows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.records.method import knows_relations, knows_truth, may_look
from apo_bench.records.row import Row
from apo_bench.records.settings import RANGE
from apo_bench.statistics.rates import Place, by_place, order


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

    def reference(self, method: str) -> CurveSetting:
        """The setting that this one is compared with: `none` asks for no relations, and few methods for looks."""
        other = self._replace(method=method, looks=self.looks if may_look(method) else 0)
        return other if knows_relations(method) else other._replace(relations="given")


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

    def at(self, levels: Array) -> Array:
        """(n, ...) the columns of some of the levels."""
        return np.asarray(self.success[:, np.searchsorted(self.levels, levels)])


def curves(rows: Iterable[Row]) -> tuple[Curve, ...]:
    """One per setting that has two levels or more, sorted as `tally` sorts; the oracle meets no level.

    Where poses are drawn a level is as many degrees as mm; trials with another pair of the two are on no curve.

    Raises:
        InputError: A trial is there twice.
    """
    groups: dict[CurveSetting, dict[float, dict[int, bool]]] = {}
    cells = by_place(rows)
    for place in sorted(cells, key=order):
        results = {seed: row["success"] for seed, row in cells[place].items() if row["success"] is not None}
        if (
            results
            and not knows_truth(place.method)
            and place.level_deg == (0.0 if place.noise == RANGE else place.level)
        ):
            groups.setdefault(curve_setting(place), {})[place.level] = results
    return tuple(_curve(setting, found) for setting, found in groups.items() if len(found) > 1)


def curve_setting(place: Place) -> CurveSetting:
    """The setting of a cell."""
    return CurveSetting(*(getattr(place, name) for name in CurveSetting._fields))


def _curve(setting: CurveSetting, found: Mapping[float, Mapping[int, bool]]) -> Curve:
    levels = np.array(sorted(found))
    seeds = tuple(sorted(set().union(*found.values())))
    columns = [[float(found[level].get(seed, np.nan)) for seed in seeds] for level in levels.tolist()]
    return Curve(setting, levels, seeds, np.array(columns).T)
