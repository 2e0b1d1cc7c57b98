"""The gap of the contacts as seen and as planned."""

from collections.abc import Sequence

from apo_bench.report.tables.table import Column, Table, level_text, millimetres, place_columns
from apo_bench.statistics.gaps import GapSummary

_NOTE = (
    "The largest distance of any face from the one it should touch, as it was seen and as the method planned it: "
    "medians, and in the drawing bands from the 5th to the 95th percentile of the trials. What is below 0.001 mm is "
    "drawn there. `none` plans what was seen."
)


def gap_table(gaps: Sequence[GapSummary]) -> Table:
    """One line per cell."""
    return Table(gaps, _COLUMNS, note=_NOTE)


_COLUMNS = (
    *place_columns(),
    Column("", "level", text=level_text),
    Column("trials", "n"),
    Column("seen_5", value=lambda g: g.seen.low),
    Column("seen_median_mm", "as seen [mm]", lambda g: g.seen.median, lambda g: millimetres(g.seen.median)),
    Column("seen_95", value=lambda g: g.seen.high),
    Column("planned_5", value=lambda g: g.planned.low),
    Column("planned_median_mm", "as planned [mm]", lambda g: g.planned.median, lambda g: millimetres(g.planned.median)),
    Column("planned_95", "95 % are below [mm]", lambda g: g.planned.high, lambda g: millimetres(g.planned.high)),
)
