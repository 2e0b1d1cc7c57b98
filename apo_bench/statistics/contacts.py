"""Contacts over the noise: quantiles of their gap before and after correction, precision and recall of those that were
recognised."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.io.grouping import grouped
from apo_bench.records import RECOGNISED, Row, knows_relations, look_up
from apo_bench.statistics.forecasts import ALL
from apo_bench.statistics.rates import Place, Rate, order, place_of

_CUTS = (5.0, 50.0, 95.0)


class Quantiles(NamedTuple):
    """Of gaps, [mm]."""

    low: float
    median: float
    high: float


@final
@dataclass(frozen=True)
class GapSummary:
    """Of the trials of a cell that had a plan."""

    place: Place
    trials: int
    seen: Quantiles
    planned: Quantiles


class ObservationPlace(NamedTuple):
    """What the observations that are counted together have in common."""

    scenario: str
    noise: str
    eye: str
    relations: str
    careless: float
    level: float
    level_deg: float


@final
@dataclass(frozen=True)
class Recognition:
    """Contacts of the observations that differ in nothing but the seed."""

    place: ObservationPlace
    demonstrations: int
    complete: int
    """Demonstrations of which every contact was recognised, and no other."""
    right: int
    missed: int
    false: int

    @property
    def precision(self) -> float | None:
        """Share of the recognised contacts that are right; None if there are none."""
        return Rate(self.right, self.right + self.false).rate

    @property
    def recall(self) -> float | None:
        """Share of the right contacts that were recognised."""
        return Rate(self.right, self.right + self.missed).rate

    @property
    def all_right(self) -> Rate:
        """Of the demonstrations, those that are complete."""
        return Rate(self.complete, self.demonstrations)


def gaps(rows: Iterable[Row]) -> tuple[GapSummary, ...]:
    """One per cell of a method that corrects, sorted as `tally` sorts."""
    both = ((place_of(row), (row.get("gap_before_mm"), row.get("gap_after_mm"))) for row in rows)
    groups = grouped((at, gap) for at, gap in both if at and knows_relations(at.method) and None not in gap)
    summaries = []
    for place in sorted(groups, key=order):
        seen, planned = (Quantiles(*q.tolist()) for q in np.percentile(np.array(groups[place]), _CUTS, axis=0).T)
        summaries.append(GapSummary(place, len(groups[place]), seen, planned))
    return tuple(summaries)


def recognitions(rows: Iterable[Row]) -> tuple[Recognition, ...]:
    """One per scenario, noise, eye, way of recognising, carelessness and level; and over all scenarios, where several.

    Methods of one seed were told the same, so each observation counts once.
    """
    seen: dict[tuple[Any, ...], tuple[ObservationPlace, Row]] = {}
    for row in rows:
        if row["relations"] in RECOGNISED and row["contacts_right"] is not None and row["level"] is not None:
            place = ObservationPlace(*(look_up(row, name) for name in ObservationPlace._fields))
            seen.setdefault((place, row["seed"], row["clearance_mm"]), (place, row))
    several = len({place.scenario for place, _ in seen.values()}) > 1
    groups = grouped([*seen.values(), *[(place._replace(scenario=ALL), row) for place, row in seen.values()] * several])
    return tuple(_counted(place, groups[place]) for place in sorted(groups, key=_order))


def _counted(place: ObservationPlace, rows: Sequence[Row]) -> Recognition:
    right, missed, false = (sum(look_up(row, f"contacts_{of}") for row in rows) for of in ("right", "missed", "false"))
    complete = sum(row["contacts_missed"] == row["contacts_false"] == 0 for row in rows)
    return Recognition(place, len(rows), complete, right, missed, false)


def _order(place: ObservationPlace) -> tuple[Any, ...]:
    """All scenarios last; the ways of recognising in their own order."""
    kind = RECOGNISED.index(place.relations)
    return (place.scenario == ALL, place.scenario, place.noise, place.eye, kind, place.careless, *place[-2:])
