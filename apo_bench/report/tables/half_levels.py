"""How much noise a method bears: the level of half success, and the area under success over level."""

from collections.abc import Sequence

from apo_bench.report.tables.table import Column, Table, interval_columns, place_columns
from apo_bench.statistics.levels.curves import Area, AreaDifference
from apo_bench.statistics.levels.half_level import HalfLevel
from apo_bench.statistics.rate_text import points

_NOTE = (
    "Where success falls to one half, read along the logarithm of the level, with a 95 % interval; *surely* is from "
    "the last level with success surely over one half to the first surely under it, whatever the curve between them. "
    "*Any* is an interval that is open at both ends, *none* is under one half even at level 0. "
    "The area is mean success over the logarithm of the level, from 0 to 1, of seeds that have a result at every level."
)
_NONE = "No level varied, so nothing is known of how success falls with it."
_WHERE = place_columns(lambda x: x.setting, levels=False)


def half_table(levels: Sequence[HalfLevel], areas: Sequence[Area]) -> Table:
    """One line per method and setting; in files a limit beyond the levels tried is empty."""
    known = {a.setting: a for a in areas if a.area is not None}

    def area(h: HalfLevel) -> str | None:
        a = known.get(h.setting)
        return None if a is None else f"{a.area:.3f} ({a.interval.low:.3f} to {a.interval.high:.3f}), {a.seeds} seeds"

    columns = (
        *_WHERE,
        Column("smallest_level", value=lambda h: h.smallest),
        Column("largest_level", value=lambda h: h.largest),
        Column("trials", "n"),
        Column("half_level", value=lambda h: h.level),
        Column("", "half success at level (95 %)", text=lambda h: f"{h.text} ({h.interval_text})"),
        Column("low_95", value=lambda h: h.low),
        Column("high_95", value=lambda h: h.high),
        Column("surely_over", "surely", text=lambda h: h.sure_text),
        Column("surely_under"),
        Column("", "area (95 %)", text=area),
    )
    return Table(levels, columns, _NONE, _NOTE)


def area_table(areas: Sequence[Area], differences: Sequence[AreaDifference]) -> Table:
    """For files: areas, whose reference is empty, and differences to those of a reference."""
    return Table([*areas, *differences], _AREAS)


def area_difference_table(differences: Sequence[AreaDifference]) -> Table:
    """For people: one line per method, setting and reference."""
    return Table(differences, _AREAS)


def _difference(d: Area | AreaDifference) -> str | None:
    return points(d.difference, d.interval) if isinstance(d, AreaDifference) else None


_AREAS = (
    *_WHERE,
    Column("reference", "against", lambda a: getattr(a, "reference", None), words=True),
    Column("smallest_level", value=lambda a: min(a.levels)),
    Column("largest_level", value=lambda a: max(a.levels)),
    Column("seeds", "seeds"),
    Column("area", value=lambda a: a.area if isinstance(a, Area) else a.difference),
    Column("", "difference of the areas [points]", text=_difference),
    *interval_columns(lambda a: a.interval),
)
