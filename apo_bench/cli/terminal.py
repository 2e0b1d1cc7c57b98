"""What a person reads on the terminal: a trial, a table of rates, the list of scenarios."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from rich.table import Table

from apo_bench.cli.printing import console
from apo_bench.io import clean, has_parquet
from apo_bench.records import RANGE, SETTINGS, FreedSet, MovedInHand, Predicted, Row, feels, look_up
from apo_bench.report.tables.cells import cell_table
from apo_bench.report.tables.methods import prediction_summary
from apo_bench.report.tables.table import Column
from apo_bench.report.tables.table import Table as Data
from apo_bench.scenario.scenario import Scenario
from apo_bench.statistics import Cell, confusions, level_label
from apo_bench.trial.promise import promise_sentence

if TYPE_CHECKING:
    from apo_bench.report.comparison.compare import Comparison
    from apo_bench.report.report import Report

_MOST_NAMES = 8
"""Settings that differ, named on the terminal."""


def print_table(table: Data) -> None:
    """A table for people."""
    printed = Table(box=None, pad_edge=False)
    for column in table.shown:
        printed.add_column(column.head, justify="left" if column.words else "right")
    for line in table.lines:
        _add(printed, *line)
    console().print(printed)


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
    console().print(table)


def print_cells(cells: Sequence[Cell]) -> None:
    """Success rates with their intervals."""
    print_table(cell_table(cells))
    excluded = sum(c.excluded for c in cells)
    if excluded:
        left = "1 row is" if excluded == 1 else f"{excluded:,} rows are"
        console().print(f"{left} left out, since the demonstration itself was not right.")


def print_report(report: Report) -> None:
    """The answer, how often plans predicted what happened, and where everything was written."""
    lines = [prediction_summary(report.confusions[-1])]
    if report.no_pictures:
        drawn = "1 failure was" if report.pictures == 1 else f"{report.pictures} failures were"
        lines.append(f"{drawn} drawn. Not drawn: {'; '.join(report.no_pictures)}.")
    lines.append(f"Answer:  {report.answer.replace('`', '')}")
    same = "the same as .parquet" if has_parquet() else "as .parquet too with the package pyarrow"
    lines.append(f"Tables:  {report.tables['cells']} and {len(report.tables) - 1} more there, {same}")
    if report.figures:
        lines.append(f"Figures: {report.figures[0]} and {len(report.figures) - 1} more there")
    lines.append(f"Report:  {report.page}")
    for line in lines:
        console().print(clean(line))


def print_comparison(comparison: Comparison) -> None:
    """How far two sweeps agree, and what is not the same in them."""
    from apo_bench.report.comparison.text import comparison_tables, in_words

    console().print(clean(in_words(comparison)))
    print_table(comparison_tables(comparison)["agreement"])
    names = [line["what"] for line in comparison.differences]
    more = f" and {len(names) - _MOST_NAMES} more" * (len(names) > _MOST_NAMES)
    differ = clean(f"Not the same: {', '.join(names[:_MOST_NAMES])}{more}")
    console().print(differ if names else "Made with the same.")


def print_prediction(rows: Iterable[Row]) -> None:
    """In one line, how often plans predicted what happened."""
    console().print(prediction_summary(confusions(rows)[-1]))


def _add(table: Table, *cells: str) -> None:
    """A row of texts, whatever they hold."""
    table.add_row(*map(clean, cells))


def _lines(row: Row) -> list[tuple[str, str]]:
    if row["level"] is None:
        trial = "measured observation"
    else:
        level = level_label(row["level"], row["level_deg"] or 0.0, row["noise"])
        trial = f"level {level}, careless {row['careless']:g}, seed {row['seed']}"
        trial += ", range finder" if row["eye"] == RANGE else f", {row['noise']} noise" * (row["noise"] != "isotropic")
        trial += f", relations {row['relations']}" * (row["relations"] != "given")
        trial += f", {row['looks']} looks allowed" * bool(row["looks"])
        trial += f", robot error {row['robot_error']}" * (row["robot_error"] != "none")
        for name in ("wrench", "stated_error") if feels(row["method"]) else ():
            said = look_up(row, name) or SETTINGS[name].default
            trial += f", {name.replace('_', ' ')} {said}" * (said != SETTINGS[name].default)
        abstain = row.get("abstain", 0.0)
        trial += f", abstaining below {abstain:g}" * bool(abstain)
    lines = [
        ("scenario", f"{row['scenario']}, {row['grasp']} grasp, {row['clearance_mm']:g} mm clearance"),
        ("trial", trial),
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
        moved = ", ".join(f"operation {move['operation']} by {move['mm']:.1f} mm" for move in row["free_moved"])
        lines.append(("free directions", f"{moved}, so that the plan fits"))
    if row["predicted"] is not None:
        lines.append(("predicted", _predicted(row["predicted"])))
    if (promised := row.get("promised")) is not None:
        lines.append(("promised", promise_sentence(promised)))
    if row["worst_gap_mm"] is not None:
        reached = f"least overlap {row['least_overlap']:.2f}, worst gap {row['worst_gap_mm']:.3f} mm"
        missed = "" if row["loose_success"] else "not every contact was made, even loosely: "
        lines.append(("reached", f"{missed}{reached}"))
    if row["pose_error_fixed_mm"] is not None:
        lines.append(("pose error", _errors(row["pose_error_fixed_mm"], row["pose_error_free_mm"])))
    if row["planned_error_fixed_mm"] is not None:
        lines.append(("planned error", _errors(row["planned_error_fixed_mm"], row["planned_error_free_mm"])))
    if row["p_value"] is not None:
        lines.append(("test", _test(row)))
    if row["sim_seconds"] is not None:
        lines.append(("peak force", f"{row['peak_force_n']:.1f} N in {row['sim_seconds']:.1f} simulated seconds"))
    if (touches := row.get("touches")) is not None:
        lines.append(("felt", _felt(row, touches)))
    if row["moved_in_hand"]:
        lines.append(("in the hand", _in_hand(row["moved_in_hand"], row["failure_operation"])))
    return lines


def _errors(fixed_mm: float | None, free_mm: float | None) -> str:
    return f"{fixed_mm:.3f} mm fixed by contacts, {free_mm:.3f} mm free"


def _felt(row: Row, touches: int) -> str:
    """`its base is off by 0.62 mm and 0.08 degrees (deviations 0.05 and 0.01): 9 touches, 1 more refused`."""
    off = f"its base is off by {row['felt_mm']:.2f} mm and {row['felt_deg']:.2f} degrees"
    sure = f"deviations {row['felt_sure_mm']:.2f} and {row['felt_sure_deg']:.2f}"
    refused = f", {row['touches_refused']} more refused" * bool(row["touches_refused"])
    return f"{off} ({sure}): {touches} touch{'es' * (touches != 1)}{refused}"


def _in_hand(moved: Sequence[MovedInHand], failed: int | None) -> str:
    """Of the operation that failed, where its part was held, else of the part that turned most."""
    most = max(moved, key=lambda part: (part["operation"] == failed, part["deg"]))
    before = f"{most['carried_mm']:.2f} mm and {most['carried_deg']:.2f} degrees before it was put to its place"
    return f"the part of operation {most['operation']} moved {before}, {most['mm']:.2f} and {most['deg']:.2f} in all"


def _attempt(attempt: FreedSet) -> str:
    left = "did not come to rest" if attempt["gap_mm"] is None else f"leaves {attempt['gap_mm']:.3f} mm"
    return f"{_braced(attempt['free'])} {left}"


def _braced(operations: Iterable[int]) -> str:
    """`{5,4,3}`, as the paper writes sets of operations."""
    return "{" + ",".join(map(str, operations)) + "}"


def _predicted(outcome: Predicted) -> str:
    if not outcome["fails"]:
        return f"it fits, {outcome['size_mm']:.2f} mm off at most"
    size = "" if outcome["size_mm"] is None else f", {outcome['size_mm']:.2f} mm"
    return f"operation {outcome['operation']} fails: {outcome['code']}{size}"


def _test(row: Row) -> str:
    """`chi-square 31.2 of 13, p 0.003: not explained by the stated noise; one of R2, R4 may be wrong; left out: R2`."""
    explained = f"{'' if row['test_passes'] else 'not '}explained by the stated noise"
    p = f"p {row['p_value']:.2g}" if row["p_value"] else "p < 1e-300"
    parts = [f"chi-square {row['chi_square'] or 0.0:.1f} of {row['chi_square_freedom']}, {p}: {explained}"]
    if row["suspects"]:
        parts.append(f"{'one of ' * (len(row['suspects']) > 1)}{', '.join(row['suspects'])} may be wrong")
    if row["dropped"]:
        parts.append(f"left out: {', '.join(row['dropped'])}")
    return "; ".join(parts)


def _result(row: Row) -> str:
    if row["success"] is None:
        return "none: the demonstration failed"
    if row["success"]:
        return "success" if row["as_demonstrated"] else f"success, not as demonstrated: {row['as_demonstrated_code']}"
    loosely = ", loosely right" if row["loose_success"] else ""
    where = "" if row["failure_operation"] is None else f", operation {row['failure_operation']}"
    return f"failure at stage {row['failure_stage']}: {row['failure_code']}{where}{loosely}"
