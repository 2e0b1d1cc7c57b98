"""What was said beforehand against what then happened: how uncertain corrections say they are, which relations their
test finds wrong, and which plans were predicted to fail."""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import final

from apo_bench.io.grouping import grouped
from apo_bench.records import Row, knows_truth
from apo_bench.statistics.rates import NOT_EXECUTED, Rate, by_method, rank, rank_relations

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
