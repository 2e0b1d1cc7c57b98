"""What a person reads on the terminal: a trial, a table of rates, the list of scenarios."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from apo_bench.io.plain_text import clean
from apo_bench.records.row import FreedSet, MovedInHand, Predicted, Row
from apo_bench.records.settings import RANGE
from apo_bench.report.tables.cells import cell_table
from apo_bench.report.tables.confusion import prediction_summary
from apo_bench.report.tables.table import Column
from apo_bench.report.tables.table import Table as Data
from apo_bench.scenario.scenario import Scenario
from apo_bench.statistics.confusion import confusions
from apo_bench.statistics.rate_text import level_label
from apo_bench.statistics.rates import Cell

if TYPE_CHECKING:
    from apo_bench.report.compare import Comparison
    from apo_bench.report.report import Report

_MOST_NAMES = 8
"""Settings that differ, named on the terminal."""


def print_table(table: Data) -> None:
    """A table for people."""
    made = Table(box=None, pad_edge=False)
    for column in table.shown:
        made.add_column(column.head, justify="left" if column.words else "right")
    for line in table.lines:
        _add(made, *line)
    _console().print(made)


def print_scenarios(scenarios: Sequence[Scenario]) -> None:
    """Name, operations, title and place in the paper of each."""
    columns = (
        Column("name", "scenario", words=True),
        Column("operations", "operations", lambda s: len(s.assembly), words=True),
        Column("title", "title", words=True),
        Column("paper", "paper", words=True),
    )
    print_table(Data(scenarios, columns))


def print_row(row: Row) -> None:
    """One trial, from what was asked to how it ended."""
    table = Table(show_header=False, box=None, pad_edge=False)
    for name, value in _lines(row):
        _add(table, name, value)
    _console().print(table)


def print_cells(cells: Sequence[Cell]) -> None:
    """Success rates with their intervals."""
    print_table(cell_table(cells))
    excluded = sum(c.excluded for c in cells)
    if excluded:
        left = "1 row is" if excluded == 1 else f"{excluded:,} rows are"
        _console().print(f"{left} left out, since the demonstration itself was not right.")


def print_report(made: Report) -> None:
    """The answer, how often plans predicted what happened, and where everything was written."""
    console = _console()

    def say(text: str) -> None:
        console.print(clean(text))

    say(prediction_summary(made.confusions[-1]))
    if made.no_pictures:
        drawn = "1 failure was" if made.pictures == 1 else f"{made.pictures} failures were"
        say(f"{drawn} drawn. Not drawn: {'; '.join(made.no_pictures)}.")
    say(f"Answer:  {made.answer.replace('`', '')}")
    say(f"Tables:  {made.tables['cells']} and {len(made.tables) - 1} more there, the same as .parquet")
    if made.figures:
        say(f"Figures: {made.figures[0]} and {len(made.figures) - 1} more there")
    say(f"Report:  {made.page}")


def print_comparison(found: Comparison) -> None:
    """How far two sweeps agree, and what is not the same in them."""
    from apo_bench.report.compare_text import agreement_table, in_words

    _console().print(clean(in_words(found)))
    print_table(agreement_table(found))
    names = [d.what for d in found.differences]
    more = f" and {len(names) - _MOST_NAMES} more" * (len(names) > _MOST_NAMES)
    differ = clean(f"Not the same: {', '.join(names[:_MOST_NAMES])}{more}")
    _console().print(differ if names else "Made with the same.")


def print_prediction(rows: Iterable[Row]) -> None:
    """In one line, how often plans predicted what happened."""
    _console().print(prediction_summary(confusions(rows)[-1]))


def _add(table: Table, *cells: str) -> None:
    """A row of texts, whatever they hold."""
    table.add_row(*map(clean, cells))


def _lines(row: Row) -> list[tuple[str, str]]:
    if row["level"] is None:
        asked = "measured observation"
    else:
        level = level_label(row["level"], row["level_deg"] or 0.0, row["noise"])
        asked = f"level {level}, careless {row['careless']:g}, seed {row['seed']}"
        asked += ", range finder" if row["eye"] == RANGE else f", {row['noise']} noise" * (row["noise"] != "isotropic")
        asked += f", relations {row['relations']}" * (row["relations"] != "given")
        asked += f", {row['looks']} looks allowed" * bool(row["looks"])
        asked += f", robot error {row['robot_error']}" * (row["robot_error"] != "none")
    lines = [
        ("scenario", f"{row['scenario']}, {row['grasp']} grasp, {row['clearance_mm']:g} mm clearance"),
        ("trial", asked),
        ("method", row["method"]),
        ("result", _result(row)),
        ("ended", row["sentence"] or ""),
    ]
    if row["gap_before_mm"] is not None:
        gaps = f"{row['gap_before_mm']:.3f} mm as seen"
        gaps += "" if row["gap_after_mm"] is None else f", {row['gap_after_mm']:.3f} mm as planned"
        lines.append(("contact gap", gaps))
    for attempt in row["tried"] or ():
        lines.append((f"after step {attempt['step']}", _attempt(attempt)))
    if row["freed"]:
        lines.append(("freed", _braced(row["freed"])))
    if row["extra_operations"]:
        lines.append(("schedule", f"{row['extra_operations']} operations beyond doing each once"))
    if row["free_moved"]:
        moved = ", ".join(f"operation {one['operation']} by {one['mm']:.1f} mm" for one in row["free_moved"])
        lines.append(("free directions", f"{moved}, so that the plan fits"))
    if row["predicted"] is not None:
        lines.append(("predicted", _predicted(row["predicted"])))
    if row["worst_gap_mm"] is not None:
        reached = f"least overlap {row['least_overlap']:.2f}, worst gap {row['worst_gap_mm']:.3f} mm"
        missed = "" if row["loose_success"] else "not every contact was made, even loosely: "
        lines.append(("reached", f"{missed}{reached}"))
    if row["pose_error_fixed_mm"] is not None:
        errors = f"{row['pose_error_fixed_mm']:.3f} mm fixed by contacts, {row['pose_error_free_mm']:.3f} mm free"
        lines.append(("pose error", errors))
    if row["planned_error_fixed_mm"] is not None:
        planned = (
            f"{row['planned_error_fixed_mm']:.3f} mm fixed by contacts, {row['planned_error_free_mm']:.3f} mm free"
        )
        lines.append(("planned error", planned))
    if row["p_value"] is not None:
        lines.append(("test", _test(row)))
    if row["sim_seconds"] is not None:
        lines.append(("peak force", f"{row['peak_force_n']:.1f} N in {row['sim_seconds']:.1f} simulated seconds"))
    if row["moved_in_hand"]:
        lines.append(("in the hand", _in_hand(row["moved_in_hand"], row["failure_operation"])))
    return lines


def _in_hand(moved: Sequence[MovedInHand], failed: int | None) -> str:
    """Of the operation that failed, where its part was held, else of the part that turned most."""
    one = max(moved, key=lambda each: (each["operation"] == failed, each["deg"]))
    before = f"{one['carried_mm']:.2f} mm and {one['carried_deg']:.2f} degrees before it was put to its place"
    return f"the part of operation {one['operation']} moved {before}, {one['mm']:.2f} and {one['deg']:.2f} in all"


def _attempt(attempt: FreedSet) -> str:
    left = "did not come to rest" if attempt["gap_mm"] is None else f"leaves {attempt['gap_mm']:.3f} mm"
    return f"{_braced(attempt['free'])} {left}"


def _braced(operations: Iterable[int]) -> str:
    """`{5,4,3}`, as the paper writes sets of operations."""
    return "{" + ",".join(map(str, operations)) + "}"


def _predicted(said: Predicted) -> str:
    if not said["fails"]:
        return f"it fits, {said['size_mm']:.2f} mm off at most"
    size = "" if said["size_mm"] is None else f", {said['size_mm']:.2f} mm"
    return f"operation {said['operation']} fails: {said['code']}{size}"


def _test(row: Row) -> str:
    """`chi-square 31.2 of 13, p 0.003: not explained by the stated noise; one of R2, R4 may be wrong; left out: R2`."""
    explained = f"{'' if row['test_passes'] else 'not '}explained by the stated noise"
    p = f"p {row['p_value']:.2g}" if row["p_value"] else "p < 1e-300"
    said = [f"chi-square {row['chi_square'] or 0.0:.1f} of {row['chi_square_freedom']}, {p}: {explained}"]
    if row["suspects"]:
        said.append(f"{'one of ' * (len(row['suspects']) > 1)}{', '.join(row['suspects'])} may be wrong")
    if row["dropped"]:
        said.append(f"left out: {', '.join(row['dropped'])}")
    return "; ".join(said)


def _result(row: Row) -> str:
    if row["success"] is None:
        return "none: the demonstration failed"
    if row["success"]:
        return "success" if row["as_demonstrated"] else f"success, not as demonstrated: {row['as_demonstrated_code']}"
    loosely = ", loosely right" if row["loose_success"] else ""
    where = "" if row["failure_operation"] is None else f", operation {row['failure_operation']}"
    return f"failure at stage {row['failure_stage']}: {row['failure_code']}{where}{loosely}"


def _console() -> Console:
    """A console as wide as the terminal, or wide enough to keep lines whole where there is none."""
    narrowest = 110 if sys.stdout.isatty() else 160
    return Console(width=max(narrowest, Console().width), highlight=False, markup=False)
