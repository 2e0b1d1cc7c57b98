"""A comparison in words: tables for the terminal and the page, and one JSON object."""

from collections.abc import Callable
from typing import Any

from apo_bench.records import KEY, Row, row_key
from apo_bench.records.run.replay_command import replay_command
from apo_bench.records.run.report_rows import NUMBERS
from apo_bench.report.comparison.compare import Agreement, CellPair, Comparison, Side
from apo_bench.report.run.facts import limits_of, scenario_files, value_words
from apo_bench.report.run.trials import verdict, why
from apo_bench.report.tables.table import Column, Table, level_text
from apo_bench.statistics import (
    FEWEST_SEEDS,
    Cell,
    Place,
    Rate,
    cell_place,
    percent,
    percents,
    place_of,
    points,
    setting_of,
)

_SCHEMA = "apo-bench/comparison/1"
MOST_LISTED = 2000
"""Changed trials that are listed."""
_AGREEMENT = (
    "The same trials in both: how often success is the same, with Wilson's interval, and how often stage "
    "and code of a failure are as well. Trials of one seed share their random numbers, so those "
    "intervals are too narrow where disagreements come in bunches; *same in all* counts the seeds with which every "
    "trial has the same verdict in both, and these are independent. *Right in the first alone* are trials "
    "that the second lost. The difference of success is the second minus the first, with Tango's interval for pairs "
    "(95 %), over trials too. Trials whose demonstration was not right in either are left out here."
)
_NUMBERS = "Of trials that have the number in both: in how many it is not exactly the same, and by how much at most."
_CELLS = (
    "Rates over all trials of each side; alone and the difference, second minus first, over the trials that they share."
)


def agreement_table(comparison: Comparison) -> Table:
    """Verdicts that agree, by scenario and of all."""
    columns = (
        _both("scenario")._replace(words=True),
        _both("trials", lambda a: a.same.trials),
        _both("same verdict", lambda a: _counted(a.same)),
        _both("95 %", lambda a: percents(a.same.interval, 2)),
        _both("seeds", lambda a: a.same_everywhere.trials),
        _both("same in all", lambda a: _counted(a.same_everywhere)),
        _both("95 %", lambda a: percents(a.same_everywhere.interval, 2), "95 % 2"),
        _both("same stage and code", lambda a: _counted(a.same_ending)),
        _both("right in the first alone", lambda a: a.only_first),
        _both("right in the second alone", lambda a: a.only_second),
        _both("difference of success [points]", lambda a: points(a.difference, a.interval)),
    )
    return Table(comparison.agreements, columns, note=_AGREEMENT)


def difference_table(comparison: Comparison) -> Table:
    """What is not the same in both."""
    columns = (
        _both("what"),
        _both(str(comparison.first.folder), lambda d: _value(d.first)),
        _both(str(comparison.second.folder), lambda d: _value(d.second)),
    )
    return Table(
        comparison.differences, [c._replace(words=True) for c in columns], "Nothing that is said of them differs."
    )


def number_table(comparison: Comparison) -> Table:
    """How far numbers of the same trials are apart."""
    columns = (
        _both("number", lambda a: NUMBERS[a.name])._replace(words=True),
        _both("trials", lambda a: a.both),
        _both("differ"),
        _both("largest difference", lambda a: f"{a.most:.3g}" if a.both else None),
        _both("in one alone", lambda a: a.alone),
    )
    return Table(comparison.numbers, columns, note=_NUMBERS)


def rate_pair_table(comparison: Comparison) -> Table:
    """Rates of both, cell by cell."""
    columns = (
        *(c._replace(words=True) for c in _where(_place_of_pair)),
        _both("first", lambda p: _rate(p.first)),
        _both("second", lambda p: _rate(p.second)),
        _both("shared"),
        _both("first alone", lambda p: p.only_first),
        _both("second alone", lambda p: p.only_second),
        _both("difference [points]", lambda p: points(p.difference, p.interval)),
    )
    return Table(comparison.cells, columns, note=_CELLS)


def changed_table(comparison: Comparison) -> Table:
    """The trials whose verdicts differ, with both sentences and commands."""
    columns = (
        *_where(lambda pair: place_of(pair[0])),
        _both("seed", lambda pair: pair[0]["seed"]),
        _both("first", lambda pair: f"{verdict(pair[0])} {why(pair[0])}".strip()),
        _both("in words", lambda pair: pair[0].get("sentence")),
        _both("second", lambda pair: f"{verdict(pair[1])} {why(pair[1])}".strip()),
        _both("in words", lambda pair: pair[1].get("sentence"), "in words 2"),
        _both("command of the first", lambda pair: _command(pair[0], comparison.first)),
        _both("command of the second", lambda pair: _command(pair[1], comparison.second)),
    )
    return Table(comparison.changed[:MOST_LISTED], [c._replace(words=True) for c in columns], "No verdict differs.")


def in_words(comparison: Comparison) -> str:
    """The whole in some sentences, counts first."""
    first, second = comparison.alone
    shared = f"{_trials(comparison.shared)} in both, {first:,} in the first alone, {second:,} in the second alone."
    identical = f"{_trials(comparison.identical)} the same to the last digit."
    return f"{shared} {_agreed(comparison.agreements[-1])} {identical}"


def _agreed(total: Agreement) -> str:
    """How many verdicts agree, and at how many seeds all of them do; seeds are independent, trials are not."""
    same = total.same
    seeds = total.same_everywhere
    if not same.trials:
        return "None of them counts: no demonstration was right itself."
    right = f"{total.only_first:,} right in the first alone, {total.only_second:,} in the second alone"
    counted = f", {total.excluded_in_one:,} counted in one of the two alone" * bool(total.excluded_in_one)
    if seeds.trials < FEWEST_SEEDS:
        sure = f"too few for an interval: from {FEWEST_SEEDS} on there is one"
    else:
        sure = f"95 % interval {percents(seeds.interval)} of seeds"
    return (
        f"Verdicts agree in {same.successes:,} of {same.trials:,} ({percent(same.rate, 2)}): {right}{counted}. All of "
        f"them agree at {seeds.successes:,} of {seeds.trials:,} seed{'s' * (seeds.trials != 1)} ({sure})."
    )


def _trials(n: int) -> str:
    return "1 trial is" if n == 1 else f"{n:,} trials are"


def comparison_form(comparison: Comparison) -> dict[str, Any]:
    """A comparison as JSON holds it."""
    return {
        "schema": _SCHEMA,
        "first": str(comparison.first.folder),
        "second": str(comparison.second.folder),
        "verdict": "success",
        "shared": comparison.shared,
        "first_alone": comparison.alone[0],
        "second_alone": comparison.alone[1],
        "identical": comparison.identical,
        "agreements": [_agreement_form(a) for a in comparison.agreements],
        "numbers": [a._asdict() for a in comparison.numbers],
        "differences": [d._asdict() for d in comparison.differences],
        "changed": [_changed_form(pair, comparison) for pair in comparison.changed],
    }


def _both(head: str, value: Callable[[Any], object] | None = None, name: str = "") -> Column:
    """A column that files and people read alike; `name` is its own in files, where heads are not."""
    return Column(name or head, head, value)


def _where(of: Callable[[Any], Any]) -> tuple[Column, ...]:
    return (
        _both("scenario", lambda x: of(x).scenario),
        _both("conditions", lambda x: ", ".join(setting_of(of(x)).conditions())),
        _both("method", lambda x: of(x).method),
        _both("level", lambda x: level_text(of(x))),
    )


def _place_of_pair(pair: CellPair) -> Place:
    """Whatever the fidelity."""
    cell = pair.first or pair.second
    assert cell is not None
    return cell_place(cell)._replace(fidelity="full")


def _counted(r: Rate) -> str:
    return f"{r.successes} ({percent(r.rate, 2)})"


def _rate(cell: Cell | None) -> str | None:
    return None if cell is None else f"{percent(cell.rate)}, n {cell.trials}"


def _value(x: Any) -> str:
    return "not said" if x is None else value_words(x)


def _command(row: Row, side: Side) -> str:
    return replay_command(row, scenario_files(side.run), limits_of(side.run))


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


def _changed_form(pair: tuple[Row, Row], comparison: Comparison) -> dict[str, Any]:
    a, b = pair
    sides = {
        name: {
            "verdict": verdict(row),
            "stage": row["failure_stage"],
            "code": row["failure_code"],
            "sentence": row.get("sentence"),
            "command": _command(row, side),
        }
        for name, row, side in (("first", a, comparison.first), ("second", b, comparison.second))
    }
    return {**dict(zip(KEY, row_key(a), strict=True)), **sides}
