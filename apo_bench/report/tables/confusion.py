"""The confusion table of a sweep: for the page, for a file, and in one line."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from apo_bench.io.csv_file import write_csv
from apo_bench.report.page.markup import Table
from apo_bench.statistics.confusion import Confusion

COLUMNS = (
    *("scenario", "method", "predicted_fit_fitted", "predicted_fit_failed", "predicted_fail_fitted"),
    *("predicted_fail_failed", "agreement", "same_operation", "stopped", "not_executed", "excluded"),
)
HEADER = (
    *("scenario", "method", "n", "fit: fitted", "fit: failed", "fail: fitted", "fail: failed", "agreement"),
    *("right operation", "not executed", "excluded"),
)
WORDS = (
    "Before it is carried out a plan says whether it will *fit* or *fail*; then physics decides: *fitted* is made as "
    "demonstrated. An operation is right where the robot stopped at the one that was predicted. A method that gave no "
    "plan has nothing executed."
)


def write_confusions(found: Sequence[Confusion], path: Path) -> None:
    """One line per scenario and method, and one of them all."""
    lines = []
    for c in found:
        counts = (c.fit_fitted, c.fit_failed, c.fail_fitted, c.fail_failed, c.agreement)
        lines.append((c.scenario, c.method, *counts, c.same_operation, c.stopped, c.not_executed, c.excluded))
    write_csv(path, COLUMNS, lines)


def confusion_table(found: Sequence[Confusion]) -> Table:
    """For people."""
    return Table(HEADER, [_line(c) for c in found], words=2)


def confusion_lines(found: Sequence[Confusion]) -> list[str]:
    """The same in Markdown."""
    return confusion_table(found).markdown()


def summary(c: Confusion) -> str:
    """`Predicted: 96.3 % of 134 executed trials ended as foretold (counted by as_demonstrated); failures ...`"""
    if c.agreement is None:
        return "Predicted: nothing, since no trial was executed."
    trials = "1 executed trial" if c.executed == 1 else f"{c.executed} executed trials"
    return (
        f"Predicted: {100 * c.agreement:.1f} % of {trials} ended as foretold (counted by as_demonstrated); "
        f"failures that were not foretold: {c.fit_failed}, warnings that were wrong: {c.fail_fitted}."
    )


def _line(c: Confusion) -> tuple[object, ...]:
    agreement = "–" if c.agreement is None else f"{100 * c.agreement:.1f} %"
    operation = f"{c.same_operation} of {c.stopped}" if c.stopped else "–"
    counts = (c.fit_fitted, c.fit_failed, c.fail_fitted, c.fail_failed)
    return (c.scenario, c.method, c.executed, *counts, agreement, operation, c.not_executed, c.excluded)
