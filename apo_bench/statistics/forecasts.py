"""What was said beforehand against what then happened: how uncertain corrections say they are, which relations their
test finds wrong, and which plans were predicted to fail.

Contacts over the noise: quantiles of their gap before and after correction, precision and recall of those that were
recognised.
"""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.io import grouped
from apo_bench.records import RECOGNISED, Row, knows_relations, knows_truth, look_up
from apo_bench.statistics.rates import NOT_EXECUTED, Place, Rate, by_method, order, place_of, rank, rank_relations

ALL = "all"
"""Stands for every scenario, or every method."""


@final
@dataclass(frozen=True)
class Calibration:
    """Counts and errors over every level, carelessness and clearance of a sweep."""

    scenario: str
    noise: str
    relations: str
    method: str
    planned: int
    """Trials that had a plan whose error is known."""
    covered: Rate
    fixed_mm: float | None
    """Root mean square error of planned goals in directions that contacts fix; None if nothing was planned."""
    fixed_over_clearance: float | None
    free_mm: float | None
    failed_tests: Rate
    culprits: Rate


@final
@dataclass(frozen=True)
class Confusion:
    """Counts over every clearance, carelessness and level of a sweep.

    Fitted means a success that was made as demonstrated: that is what a plan predicts.
    """

    scenario: str
    method: str
    fit_fitted: int
    """Predicted to fit, and it did."""
    fit_failed: int
    fail_fitted: int
    fail_failed: int
    same_operation: int
    """Of `fail_failed`: the robot stopped at the operation that was predicted."""
    stopped: int
    """Of `fail_failed`: the robot stopped at an operation at all; of others the judge says only that they are wrong."""
    not_executed: int
    """Nothing was carried out: the method gave no plan, or one that promised too little."""
    excluded: int
    """The demonstration itself was not right."""

    @property
    def executed(self) -> int:
        return self.fit_fitted + self.fit_failed + self.fail_fitted + self.fail_failed

    @property
    def right(self) -> int:
        return self.fit_fitted + self.fail_failed

    @property
    def agreement(self) -> float | None:
        """Share of the executed trials that ended as predicted; None if there are none."""
        return Rate(self.right, self.executed).rate


def calibrations(rows: Iterable[Row]) -> tuple[Calibration, ...]:
    """One per scenario, noise, relations and method; the oracle has nothing to be calibrated."""
    groups = grouped(
        ((row["scenario"], row["noise"], row["relations"], row["method"]), row)
        for row in rows
        if row["level"] is not None and row["success"] is not None and not knows_truth(row["method"])
    )
    order = sorted(groups, key=lambda k: (k[0], k[1], rank_relations(k[2]), rank(k[3]), k[3]))
    return tuple(_calibration(*key, groups[key]) for key in order)


def confusions(rows: Iterable[Row]) -> tuple[Confusion, ...]:
    """One per scenario and method, sorted as `tally` sorts, and one of them all at the end."""
    groups = by_method(rows)
    return (
        *(_confusion(*key, own) for key, own in groups.items()),
        _confusion(ALL, ALL, [row for own in groups.values() for row in own]),
    )


def _calibration(scenario: str, noise: str, relations: str, method: str, rows: Sequence[Row]) -> Calibration:
    planned = [(row, error_mm) for row in rows if (error_mm := row["planned_error_fixed_mm"]) is not None]
    tight = [error_mm / row["clearance_mm"] for row, error_mm in planned if row["clearance_mm"] > 0]
    covered = [row["inside_95"] for row in rows if row["inside_95"] is not None]
    tested = [row for row in rows if row["test_passes"] is not None]
    failed = [row for row in tested if not row["test_passes"]]
    known = [row for row in failed if row["wrong_relation"] is not None]
    return Calibration(
        scenario=scenario,
        noise=noise,
        relations=relations,
        method=method,
        planned=len(planned),
        covered=Rate(sum(covered), len(covered)),
        fixed_mm=_rms([error_mm for _, error_mm in planned]),
        fixed_over_clearance=_rms(tight),
        free_mm=_rms([row["planned_error_free_mm"] or 0.0 for row, _ in planned]),
        failed_tests=Rate(len(failed), len(tested)),
        culprits=Rate(sum(row["wrong_relation"] in (row["suspects"] or ()) for row in known), len(known)),
    )


def _rms(numbers: Sequence[float]) -> float | None:
    return math.sqrt(sum(x * x for x in numbers) / len(numbers)) if numbers else None


def _confusion(scenario: str, method: str, rows: Sequence[Row]) -> Confusion:
    counted = [row for row in rows if row["success"] is not None]
    executed = [
        (row, forecast)
        for row in counted
        if (forecast := row["predicted"]) is not None and row["failure_stage"] not in NOT_EXECUTED
    ]
    caught = [(row, forecast) for row, forecast in executed if forecast["fails"] and not row["as_demonstrated"]]
    stopped = [(row, forecast) for row, forecast in caught if row["failure_operation"] is not None]
    # predicted to fail, and made as demonstrated
    ends = Counter((forecast["fails"], row["as_demonstrated"]) for row, forecast in executed)
    return Confusion(
        scenario=scenario,
        method=method,
        fit_fitted=ends[False, True],
        fit_failed=ends[False, False],
        fail_fitted=ends[True, True],
        fail_failed=len(caught),
        same_operation=sum(forecast["operation"] == row["failure_operation"] for row, forecast in stopped),
        stopped=len(stopped),
        not_executed=len(counted) - len(executed),
        excluded=len(rows) - len(counted),
    )


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
