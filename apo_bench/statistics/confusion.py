"""Prediction against physics: how often a plan said beforehand what then happened."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import final

from apo_bench.records.row import Row
from apo_bench.statistics.rates import by_method

ALL = "all"
"""Stands for every scenario, or every method."""


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
    """The method gave no plan, so nothing was predicted."""
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
        return self.right / self.executed if self.executed else None


def confusions(rows: Iterable[Row]) -> tuple[Confusion, ...]:
    """One per scenario and method, sorted as `tally` sorts, and one of them all at the end."""
    groups = by_method(rows)
    everything = [row for own in groups.values() for row in own]
    return (*(_counted(*key, own) for key, own in groups.items()), _counted(ALL, ALL, everything))


def _counted(scenario: str, method: str, rows: Sequence[Row]) -> Confusion:
    excluded = [row for row in rows if row["success"] is None]
    executed = [(row, said) for row in rows if (said := row["predicted"]) is not None and row["success"] is not None]
    caught = [(row, said) for row, said in executed if said["fails"] and not row["as_demonstrated"]]
    stopped = [(row, said) for row, said in caught if row["failure_operation"] is not None]

    def count(fails: bool, fitted: bool) -> int:
        return sum((said["fails"], row["as_demonstrated"]) == (fails, fitted) for row, said in executed)

    return Confusion(
        scenario=scenario,
        method=method,
        fit_fitted=count(False, True),
        fit_failed=count(False, False),
        fail_fitted=count(True, True),
        fail_failed=len(caught),
        same_operation=sum(said["operation"] == row["failure_operation"] for row, said in stopped),
        stopped=len(stopped),
        not_executed=len(rows) - len(excluded) - len(executed),
        excluded=len(excluded),
    )
