"""The paired comparisons of a sweep: for a file, and for the page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from apo_bench.io.csv_file import write_csv
from apo_bench.records.method import knows_relations
from apo_bench.statistics.paired import Paired
from apo_bench.statistics.rate_text import level_label
from apo_bench.statistics.rates import Interval, Place, Rate

COLUMNS = (
    *("scenario", "clearance_mm", "noise", "relations", "careless", "level_mm", "level_deg", "method"),
    *("grasp", "fidelity", "reference"),
    *("pairs", "only_method", "only_reference", "difference", "low_95", "high_95", "p_mcnemar", "p_adjusted"),
    *("reference_failed", "recovered", "recovery_rate", "recovery_low_95", "recovery_high_95"),
    *("reference_right", "harmed", "harm_rate", "harm_low_95", "harm_high_95"),
    *("planned", "free_difference_mm", "free_low_95_mm", "free_high_95_mm"),
)
HEADER = (
    "| scenario | clearance | noise | relations | careless | level | method | against | pairs | it alone | other alone "
    "| difference of success | p | p adjusted | recovered | harmed | difference of free error |",
    "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|",
)
WORDS = (
    "Over the same seeds: at how many of them one of the two alone was right, the difference of their success rates in "
    "points with Tango's score interval for paired proportions, McNemar's exact p-value, as it is and adjusted for all "
    "comparisons of the sweep (Holm), *recovered*, the share of the seeds at which the other failed that it mended, "
    "*harmed*, the share of the seeds at which the other was right that it spoilt, and the mean difference of the "
    "errors of their planned goals in directions that contacts leave free, over seeds at which both had a plan, with "
    "Student's t interval (intervals are of 95 %). Negative errors are smaller than the other's. With no discordant "
    "pair among n the score interval still reaches 3.84 / (n + 3.84) to both sides: 3.7 points at 100 pairs, less than "
    "3 from 125 on."
)


def write_paired(found: Sequence[Paired], path: Path) -> None:
    """One line per cell, method and reference."""
    lines = []
    for p in found:
        counts = (p.pairs, p.only_method, p.only_reference, p.difference, *p.interval, p.p, p.p_adjusted)
        mended = (*_fields(p.recovered), *_fields(p.harmed))
        free = (p.free_mm, *(p.free_interval or (None, None)))
        lines.append((*p.place, p.reference, *counts, *mended, p.planned, *free))
    write_csv(path, COLUMNS, lines)


def paired_lines(found: Sequence[Paired]) -> list[str]:
    """A Markdown table, or a sentence where there is nothing to compare."""
    return [*HEADER, *map(_line, found)] if found else ["No two methods share a cell."]


def _line(p: Paired) -> str:
    where = p.place
    level = level_label(where.level, where.level_deg, where.noise)
    return (
        f"| {where.scenario} | {where.clearance_mm:g} mm | {where.noise} | {_told(where)} | {where.careless:g} "
        f"| {level} | {where.method} | {p.reference} | {p.pairs} | {p.only_method} "
        f"| {p.only_reference} | {_points(p)} | {p_text(p.p)} | {p_text(p.p_adjusted)} | {share_text(p.recovered)} "
        f"| {share_text(p.harmed)} | {_free(p.free_mm, p.free_interval)} |"
    )


def p_text(p: float | None) -> str:
    """`0.031`, `< 0.001`."""
    if p is None:
        return "–"
    return f"{p:.3f}" if p >= 0.001 else "< 0.001"


def share_text(r: Rate) -> str:
    """`12 of 13 (66.7 to 98.6 %)`."""
    low, high = r.interval
    return f"{r.successes} of {r.trials} ({100 * low:.1f} to {100 * high:.1f} %)" if r.trials else "–"


def _fields(r: Rate) -> tuple[float | None, ...]:
    return (r.trials, r.successes, r.rate, *r.interval)


def _told(place: Place) -> str:
    return place.relations if knows_relations(place.method) else "any"


def _points(p: Paired) -> str:
    """`+4.0 (-0.3 to +9.1)`."""
    if p.difference is None:
        return "–"
    low, high = p.interval
    return f"{100 * p.difference:+.1f} ({100 * low:+.1f} to {100 * high:+.1f})"


def _free(mean: float | None, interval: Interval | None) -> str:
    if mean is None:
        return "–"
    between = "" if interval is None else f" ({interval.low:+.3f} to {interval.high:+.3f})"
    return f"{mean:+.3f} mm{between}"
