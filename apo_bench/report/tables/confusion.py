"""Prediction against physics: counted by scenario and method, and in one line."""

from collections.abc import Sequence

from apo_bench.report.tables.table import Column, Table
from apo_bench.statistics.confusion import Confusion
from apo_bench.statistics.rate_text import percent

CONFUSION_NOTE = (
    "Before it is carried out a plan says whether it will *fit* or *fail*; then physics decides: *fitted* is made as "
    "demonstrated. An operation is right where the robot stopped at the one that was predicted. A method that gave no "
    "plan has nothing executed."
)


def confusion_table(found: Sequence[Confusion]) -> Table:
    """One line per scenario and method, and one of them all."""
    return Table(found, _COLUMNS)


def prediction_summary(c: Confusion) -> str:
    """`Predicted: 129 of 134 executed trials ended as predicted (96.3 %, counted by as_demonstrated); failures ...`"""
    if c.agreement is None:
        return "Predicted: nothing, since no trial was executed."
    trials = "1 executed trial" if c.executed == 1 else f"{c.executed:,} executed trials"
    return (
        f"Predicted: {c.right:,} of {trials} ended as predicted ({percent(c.agreement)}, counted by as_demonstrated); "
        f"failures that were not predicted: {c.fit_failed}, warnings that were wrong: {c.fail_fitted}."
    )


def _operation(c: Confusion) -> str | None:
    return f"{c.same_operation} of {c.stopped}" if c.stopped else None


_COLUMNS = (
    Column("scenario", "scenario", words=True),
    Column("method", "method", words=True),
    Column("", "n", text=lambda c: c.executed),
    Column("predicted_fit_fitted", "fit: fitted", lambda c: c.fit_fitted),
    Column("predicted_fit_failed", "fit: failed", lambda c: c.fit_failed),
    Column("predicted_fail_fitted", "fail: fitted", lambda c: c.fail_fitted),
    Column("predicted_fail_failed", "fail: failed", lambda c: c.fail_failed),
    Column("agreement", "agreement", text=lambda c: percent(c.agreement)),
    Column("same_operation", "right operation", text=_operation),
    Column("stopped"),
    Column("not_executed", "not executed"),
    Column("excluded", "excluded"),
)
