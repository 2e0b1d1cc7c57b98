"""Calibration as a table: whether corrections are as uncertain as they say."""

from __future__ import annotations

from collections.abc import Sequence

from apo_bench.records.method import knows_relations
from apo_bench.report.page.markup import Table
from apo_bench.statistics.calibration import Calibration

WORDS = (
    "Over every level, carelessness and clearance. *Covered* is how often the truth lies in the 95 % region that a "
    "correction states. Errors are root mean squares of the planned goals, in directions that the contacts fix, also "
    "over the clearance, and in those that they leave free. A test *fails* where the stated noise does not explain the "
    "correction: a false alarm where the relations are as given, a catch where they are wrong. The *culprit* is how "
    "often the wrong relation, if it is one of those that were told, is in the ambiguity set of a failed test."
)
HEADER = (
    *("scenario", "noise", "relations", "method", "n", "covered", "fixed error", "over clearance", "free error"),
    *("test fails", "culprit"),
)


def calibration_table(found: Sequence[Calibration]) -> Table:
    """For people."""
    return Table(HEADER, [_line(c) for c in found], words=4)


def calibration_lines(found: Sequence[Calibration]) -> list[str]:
    """The same in Markdown, or a sentence where there is nothing to say."""
    return calibration_table(found).markdown("No method was tried.")


def _line(c: Calibration) -> tuple[object, ...]:
    errors = (_number(c.fixed_mm, " mm"), _number(c.fixed_over_clearance, ""), _number(c.free_mm, " mm"))
    told = c.relations if knows_relations(c.method) else "any"
    return (c.scenario, c.noise, told, c.method, c.planned, c.covered, *errors, c.failed_tests, c.culprits)


def _number(x: float | None, unit: str) -> str:
    return "–" if x is None else f"{x:.3g}{unit}"
