"""Contacts over the noise: quantiles of their gap before and after correction, precision and recall of those that were
recognised."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, final

import numpy as np

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
        return self.right / (self.right + self.false) if self.right + self.false else None

    @property
    def recall(self) -> float | None:
        """Share of the right contacts that were recognised."""
        return self.right / (self.right + self.missed) if self.right + self.missed else None

    @property
    def all_right(self) -> Rate:
        return Rate(self.complete, self.demonstrations)

    @property
    def completeness(self) -> float | None:
        """Share of the demonstrations that are complete."""
        return self.all_right.rate


def gaps(rows: Iterable[Row]) -> tuple[GapSummary, ...]:
    """One per cell of a method that corrects, sorted as `tally` sorts."""
    groups: dict[Place, list[tuple[float, float]]] = {}
    for row in rows:
        place = place_of(row)
        both = (row.get("gap_before_mm"), row.get("gap_after_mm"))
        if place is not None and knows_relations(place.method) and None not in both:
            groups.setdefault(place, []).append((float(both[0] or 0.0), float(both[1] or 0.0)))
    return tuple(_gap(place, groups[place]) for place in sorted(groups, key=order))


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
    groups: dict[ObservationPlace, list[Row]] = {}
    for place, row in seen.values():
        for where in (place, place._replace(scenario=ALL)) if several else (place,):
            groups.setdefault(where, []).append(row)
    return tuple(_counted(place, groups[place]) for place in sorted(groups, key=_order))


def _gap(place: Place, both: Sequence[tuple[float, float]]) -> GapSummary:
    seen, planned = (Quantiles(*map(float, q)) for q in np.percentile(np.array(both), _CUTS, axis=0).T)
    return GapSummary(place, len(both), seen, planned)


def _counted(place: ObservationPlace, rows: Sequence[Row]) -> Recognition:
    right, missed, false = (sum(look_up(row, f"contacts_{of}") for row in rows) for of in ("right", "missed", "false"))
    complete = sum(row["contacts_missed"] == row["contacts_false"] == 0 for row in rows)
    return Recognition(place, len(rows), complete, right, missed, false)


def _order(place: ObservationPlace) -> tuple[Any, ...]:
    """All scenarios last; the ways of recognising in their own order."""
    kind = RECOGNISED.index(place.relations)
    return (place.scenario == ALL, place.scenario, place.noise, place.eye, kind, place.careless, *place[-2:])
