"""A comparison in words: tables for the terminal and the page, and one JSON object."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from apo_bench.records import verdicts
from apo_bench.records.method import knows_truth
from apo_bench.records.replay_command import replay_command
from apo_bench.records.slim import NUMBERS
from apo_bench.report.compare import Agreement, Comparison, Pair
from apo_bench.report.page.behind import verdict, why
from apo_bench.report.page.markup import Table
from apo_bench.report.page.ran import limits_of, scenario_files, words
from apo_bench.report.tables.pairs import points
from apo_bench.statistics.rate_text import level_label, percent
from apo_bench.statistics.rates import Cell, Interval, place_of
from apo_bench.statistics.settings import at, level_of, setting_of

SCHEMA = "apo-bench/comparison/1"
MOST = 2000
"""Changed trials that are listed."""


def agreement_table(found: Comparison) -> Table:
    """Verdicts that agree, by scenario and of all."""
    head = ("scenario", "trials", "same verdict", "95 %", "seeds", "same in all", "95 %",
            "same stage and code", "right in the first alone", "right in the second alone",
            "difference of success [points]")  # fmt: skip
    return Table(head, [_agreement(a) for a in found.agreements])


def difference_table(found: Comparison) -> Table:
    """What is not the same in both."""
    rows: list[tuple[object, ...]] = [(d.what, _value(d.first), _value(d.second)) for d in found.differences]
    return Table(("what", str(found.first.folder), str(found.second.folder)), rows, words=3)


def number_table(found: Comparison) -> Table:
    """How far numbers of the same trials are apart."""
    head = ("number", "trials", "differ", "largest difference", "in one alone")
    rows: list[tuple[object, ...]] = [
        (NUMBERS[a.name], a.both, a.differ, f"{a.most:.3g}" if a.both else None, a.alone) for a in found.numbers
    ]
    return Table(head, rows)


def cell_table(found: Comparison) -> Table:
    """Rates of both, cell by cell."""
    head = ("scenario", "conditions", "method", "level", "first", "second", "shared", "first alone", "second alone",
            "difference [points]")  # fmt: skip
    return Table(head, [_cell(pair) for pair in found.cells], words=3)


def changed_table(found: Comparison) -> Table:
    """The trials whose verdicts differ, with both sentences and commands."""
    head = ("scenario", "conditions", "method", "level", "seed", "first", "in words", "second", "in words",
            "command of the first", "command of the second")  # fmt: skip
    ran = [(scenario_files(side.run), limits_of(side.run)) for side in (found.first, found.second)]
    rows: list[tuple[object, ...]] = []
    for a, b in found.changed[:MOST]:
        place = place_of(a)
        assert place is not None
        where = (place.scenario, ", ".join(setting_of(place).conditions()), place.method)
        level = level_label(*level_of(place), place.noise)
        ends = [(f"{verdict(row)} {why(row)}".strip(), row.get("sentence")) for row in (a, b)]
        commands = [replay_command(row, *ran[i]) for i, row in enumerate((a, b))]
        rows.append((*where, level, a["seed"], *ends[0], *ends[1], *commands))
    return Table(head, rows, words=len(head))


def in_words(found: Comparison) -> str:
    """The whole in some sentences."""
    older = verdicts.words(found.first.verdict)
    total = found.agreements[-1]
    low, high = total.same.interval
    return (
        f"{found.shared:,} trials are in both ({found.alone[0]:,} in the first alone, {found.alone[1]:,} in the second "
        f"alone). Verdicts agree in {total.same.successes:,} of {total.same.trials:,}: {share(total.same.rate)} "
        f"(95 %: {100 * low:.2f} to {100 * high:.2f} %, as if every trial were one of its own; in "
        f"{total.same_everywhere.successes:,} of {total.same_everywhere.trials:,} seeds all of them agree). "
        f"{found.identical:,} trials are the same to the last digit.{f' {older}' * bool(older)}"
    )


def comparison_form(found: Comparison) -> dict[str, Any]:
    """As JSON holds it."""
    return {
        "schema": SCHEMA,
        "first": str(found.first.folder),
        "second": str(found.second.folder),
        "verdict": found.first.verdict,
        "shared": found.shared,
        "first_alone": found.alone[0],
        "second_alone": found.alone[1],
        "identical": found.identical,
        "agreements": [_agreement_form(a) for a in found.agreements],
        "numbers": [a._asdict() for a in found.numbers],
        "differences": [d._asdict() for d in found.differences],
        "changed": [_changed_form(pair, found) for pair in found.changed],
    }


def share(rate: float | None) -> str:
    """`99.25 %`."""
    return "–" if rate is None else f"{100 * rate:.2f} %"


def _agreement(a: Agreement) -> tuple[object, ...]:
    same = (f"{a.same.successes} ({share(a.same.rate)})", _span(a.same.interval))
    seeds = a.same_everywhere
    every = (seeds.trials, f"{seeds.successes} ({share(seeds.rate)})", _span(seeds.interval))
    ending = f"{a.same_ending.successes} ({share(a.same_ending.rate)})"
    alone = (a.only_first, a.only_second, points(a.difference, a.interval))
    return (a.scenario, a.same.trials, *same, *every, ending, *alone)


def _cell(pair: Pair) -> tuple[object, ...]:
    one = pair.first or pair.second
    assert one is not None
    place = at(one)
    where = (place.scenario, ", ".join(setting_of(place._replace(fidelity="full")).conditions()), place.method)
    level = "any" if knows_truth(place.method) else level_label(place.level, place.level_deg, place.noise)
    counts = (pair.shared, pair.only_first, pair.only_second)
    return (*where, level, _rate(pair.first), _rate(pair.second), *counts, points(pair.difference, pair.interval))


def _rate(cell: Cell | None) -> str | None:
    return None if cell is None else f"{percent(cell.rate)}, n {cell.trials}"


def _span(interval: Interval) -> str:
    return f"{100 * interval.low:.2f} to {100 * interval.high:.2f} %"


def _value(x: Any) -> str:
    return "not said" if x is None else words(x)


def _agreement_form(a: Agreement) -> dict[str, Any]:
    return {
        "scenario": a.scenario,
        "trials": a.same.trials,
        "same_verdict": a.same.successes,
        "same_verdict_rate": a.same.rate,
        "same_verdict_low_95": a.same.interval.low,
        "same_verdict_high_95": a.same.interval.high,
        "seeds": a.same_everywhere.trials,
        "same_verdicts_in_all": a.same_everywhere.successes,
        "same_verdicts_in_all_low_95": a.same_everywhere.interval.low,
        "same_verdicts_in_all_high_95": a.same_everywhere.interval.high,
        "same_stage_and_code": a.same_ending.successes,
        "right_in_first_alone": a.only_first,
        "right_in_second_alone": a.only_second,
        "excluded_in_one": a.excluded_in_one,
        "difference": a.difference,
        "difference_low_95": a.interval.low,
        "difference_high_95": a.interval.high,
    }


def _changed_form(pair: tuple[Mapping[str, Any], Mapping[str, Any]], found: Comparison) -> dict[str, Any]:
    a, b = pair
    names = (
        "scenario",
        "clearance_mm",
        "seed",
        "careless",
        "level",
        "level_deg",
        "noise",
        "relations",
        "grasp",
        "method",
    )
    said = {
        name: {
            "verdict": verdict(row),
            "stage": row["failure_stage"],
            "code": row["failure_code"],
            "sentence": row.get("sentence"),
            "command": replay_command(row, scenario_files(side.run), limits_of(side.run)),
        }
        for name, row, side in (("first", a, found.first), ("second", b, found.second))
    }
    return {**{name: a[name] for name in names}, **said}
