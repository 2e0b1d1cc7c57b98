"""Whether corrections are as uncertain as they say."""

from collections.abc import Sequence

from apo_bench.records.method import knows_relations
from apo_bench.report.tables.saying import millimetres
from apo_bench.report.tables.table import Column, Table
from apo_bench.statistics.calibration import Calibration

CALIBRATION_NOTE = (
    "Over every level, carelessness and clearance. *Covered* is how often the truth lies in the 95 % region that a "
    "correction states. Errors are root mean squares of the planned goals, in directions that the contacts fix, also "
    "over the clearance, and in those that they leave free. A test *fails* where the stated noise does not explain the "
    "correction: a false alarm where the relations are as given, a catch where they are wrong. The *culprit* is how "
    "often the wrong relation, if it is one of those that were told, is in the ambiguity set of a failed test."
)


def calibration_table(found: Sequence[Calibration]) -> Table:
    """One line per scenario, noise, relations and method; for people."""
    return Table(found, _COLUMNS, "No trial of a method but the oracle counts.")


def _ratio(c: Calibration) -> str | None:
    return None if c.fixed_over_clearance is None else f"{c.fixed_over_clearance:.2f}"


_COLUMNS = (
    Column("scenario", "scenario", words=True),
    Column("noise", "noise", words=True),
    Column("relations", "relations", text=lambda c: c.relations if knows_relations(c.method) else "any", words=True),
    Column("method", "method", words=True),
    Column("planned", "n"),
    Column("covered", "covered"),
    Column("fixed_mm", "fixed error [mm]", text=lambda c: millimetres(c.fixed_mm)),
    Column("fixed_over_clearance", "over clearance", text=_ratio),
    Column("free_mm", "free error [mm]", text=lambda c: millimetres(c.free_mm)),
    Column("failed_tests", "test fails"),
    Column("culprits", "culprit"),
)
