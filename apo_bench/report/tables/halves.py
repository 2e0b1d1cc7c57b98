"""How much noise a method bears: the level of half success, and the area under success over level."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from apo_bench.io.csv_file import write_csv
from apo_bench.report.page.markup import Table
from apo_bench.report.tables.pairs import points
from apo_bench.statistics.area import Area, AreaDifference
from apo_bench.statistics.curve import Setting
from apo_bench.statistics.half_level import HalfLevel
from apo_bench.statistics.rates import Interval, Place
from apo_bench.statistics.settings import setting_of

WORDS = (
    "Where success falls to one half, read along the logarithm of the level, with a 95 % interval; *surely* is from "
    "the last level with success surely over one half to the first surely under it, whatever the curve between them. "
    "The area is mean success over the logarithm of the level, from 0 to 1, of seeds that have a result at every level."
)
NONE = "No level varied, so nothing is known of how success falls with it."
HALF = (
    *Setting._fields, "smallest_level", "largest_level", "trials", "half_level", "low_95", "high_95",
    "surely_over", "surely_under",
)  # fmt: skip
AREA = (*Setting._fields, "reference", "smallest_level", "largest_level", "seeds", "area", "low_95", "high_95")


def half_table(halves: Sequence[HalfLevel], areas: Sequence[Area]) -> Table:
    """One line per method and setting."""
    head = ("scenario", "conditions", "method", "half success at level", "95 %", "surely", "n", "area", "95 %", "seeds")
    known = {a.setting: a for a in areas}
    rows: list[tuple[object, ...]] = []
    for h in halves:
        a = known.get(h.setting)
        area = (None, None, None) if a is None or a.area is None else (f"{a.area:.3f}", _span(a.interval), a.seeds)
        rows.append((*_where(h.setting), h.text, h.interval_text, h.sure_text, h.trials, *area))
    return Table(head, rows, words=3)


def difference_table(found: Sequence[AreaDifference]) -> Table:
    """One line per method, setting and reference; areas in points of success."""
    head = ("scenario", "conditions", "method", "against", "difference of the areas [points]", "seeds")
    rows: list[tuple[object, ...]] = [
        (*_where(d.setting), d.reference, points(d.difference, d.interval), d.seeds) for d in found
    ]
    return Table(head, rows, words=4)


def write_halves(found: Sequence[HalfLevel], path: Path) -> None:
    """One line per method and setting; a limit beyond the levels tried is empty."""
    lines = []
    for h in found:
        limits = (h.level, h.low, h.high, h.surely_over, h.surely_under)
        lines.append((*h.setting, h.smallest, h.largest, h.trials, *limits))
    write_csv(path, HALF, lines)


def write_areas(areas: Sequence[Area], differences: Sequence[AreaDifference], path: Path) -> None:
    """Areas, whose reference is empty, and their differences to those of a reference."""
    lines: list[tuple[object, ...]] = [
        (*a.setting, None, min(a.levels), max(a.levels), a.seeds, a.area, *a.interval) for a in areas
    ]
    for d in differences:
        between = (min(d.levels), max(d.levels), d.seeds, d.difference, *d.interval)
        lines.append((*d.setting, d.reference, *between))
    write_csv(path, AREA, lines)


def _where(s: Setting) -> tuple[str, str, str]:
    place = Place(s.scenario, s.clearance_mm, s.noise, s.relations, s.careless, 0.0, 0.0, s.method, s.grasp, s.fidelity)
    return s.scenario, ", ".join(setting_of(place).conditions()), s.method


def _span(interval: Interval) -> str:
    return f"{interval.low:.3f} to {interval.high:.3f}"
