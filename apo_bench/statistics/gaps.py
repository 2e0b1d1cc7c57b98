"""The gap of the contacts before and after correction: quantiles over the trials of a cell."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from apo_bench.records.method import knows_relations
from apo_bench.records.row import Row
from apo_bench.statistics.rates import Place, order, place_of

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


def gaps(rows: Iterable[Row]) -> tuple[GapSummary, ...]:
    """One per cell of a method that corrects, sorted as `tally` sorts."""
    groups: dict[Place, list[tuple[float, float]]] = {}
    for row in rows:
        place = place_of(row)
        both = (row.get("gap_before_mm"), row.get("gap_after_mm"))
        if place is not None and knows_relations(place.method) and None not in both:
            groups.setdefault(place, []).append((float(both[0] or 0.0), float(both[1] or 0.0)))
    return tuple(_gap(place, groups[place]) for place in sorted(groups, key=order))


def _gap(place: Place, both: Sequence[tuple[float, float]]) -> GapSummary:
    seen, planned = (Quantiles(*map(float, q)) for q in np.percentile(np.array(both), _CUTS, axis=0).T)
    return GapSummary(place, len(both), seen, planned)
