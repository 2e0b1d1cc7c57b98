"""The report of a sweep: one page that answers, tables and figures beside it."""

from collections.abc import Collection, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from apo_bench.errors import InputError, require
from apo_bench.io import check_folders, check_target, has_parquet, write_columns, write_file
from apo_bench.records import Row, check_same_salt, one_salt, read_salt
from apo_bench.records.run.run_file import read_run
from apo_bench.records.run.run_folder import COLUMNS as KEPT
from apo_bench.records.run.run_folder import report_rows
from apo_bench.report.answer import answer
from apo_bench.report.figures.other_axes import figures
from apo_bench.report.page.report_page import report_page
from apo_bench.report.run.trials import Draw, draw_failures, scenario_files
from apo_bench.report.tables.cells import cell_table, felt_table, gap_table, pair_table
from apo_bench.report.tables.methods import (
    area_table,
    calibration_table,
    confusion_table,
    effort_table,
    half_table,
    recognition_table,
    time_table,
    work_table,
)
from apo_bench.statistics import (
    Cell,
    Confusion,
    calibrations,
    confusions,
    efforts,
    felt,
    gaps,
    members,
    read_timing,
    recognitions,
    trial_times,
    work,
)
from apo_bench.statistics.levels.half_level import Summary, summary
from apo_bench.statistics.settings import settings

MOST_PANELS = 16
"""Of a PNG; drawing more takes minutes."""
PNG = ("success_over_level", "success_over_tightness", "success_over_looks", "recognised")
"""Figures that are also kept as PNG."""
FILES = ("cells", "pairs", "half_levels", "areas", "recognised", "gaps", "confusion", "felt", "times")
"""Tables that are also kept as files; those of `_IF_ANY` if there is any line."""
_IF_ANY = ("recognised", "felt", "times")
ROWS = "rows.parquet"
OURS = (*FILES, *PNG, Path(ROWS).stem, "failure_stages", "gap_before_and_after", "prediction", "timing")
"""Names of our tables and figures, without endings; `difference_to_..` is ours too."""
PAGE = "report.html"
TABLES = "tables"
FIGURES = "figures"


class Report(NamedTuple):
    """Where the report of a sweep was written."""

    page: Path
    answer: str
    """What the sweep says, in one sentence, with methods in backquotes."""
    tables: Mapping[str, Path]
    """All, as CSV, by what they are of: `cells` are rates, `pairs`, `confusion`, ...; beside each is the same as
    Parquet, where the package pyarrow is installed."""
    figures: tuple[Path, ...]
    """All, as SVG, and as PNG where people put them into text."""
    cells: tuple[Cell, ...]
    confusions: tuple[Confusion, ...]
    pictures: int
    """Failures that were drawn."""
    no_pictures: tuple[str, ...]
    """Why others were not."""


def report(
    folder: str | Path,
    pictures: int = 0,
    salt_file: str | Path | None = None,
    *,
    trust_code: bool = False,
    draw: Draw | None = None,
) -> Report:
    """Write the page, tables and figures beside the rows of a sweep.

    Args:
        pictures: So many failures are drawn at most; most are run again for it, which takes as long as it took.
        salt_file: Of trials that were drawn with a salt; without it none of them is run again.
        trust_code: Run also trials that name code that does not come with the package. Without it nothing that a file
            of the folder names is imported.
        draw: What draws failures; without it there is no picture.

    Raises:
        InputError: No rows there, another salt, or the folder cannot be written.
    """
    folder = Path(folder)
    rows = report_rows(folder)
    require(rows, f"'{folder}' holds no finished trial yet; run the sweep before its report.")
    salt = None if salt_file is None else read_salt(salt_file)
    if salt is not None:
        check_same_salt(f"'{folder}'", salt.hash, one_salt(rows))
    numbers = summary(rows)
    require(
        numbers.cells, f"'{folder}' holds replays of measured demonstrations alone, which belong to no cell of a sweep."
    )
    try:
        check_target(folder / PAGE)
        check_folders(folder / name for name in (TABLES, FIGURES))
        for name in (TABLES, FIGURES):
            (folder / name).mkdir(exist_ok=True)
        if has_parquet():
            _write_rows(rows, folder / TABLES / ROWS)
        return _written(
            folder, rows, numbers, partial(draw_failures, most=pictures, draw=draw, salt=salt, trust_code=trust_code)
        )
    except OSError as error:
        raise InputError(f"'{folder}' cannot be written ({error.strerror}); copy it to a place that can.") from error


def _written(folder: Path, rows: Sequence[Row], numbers: Summary, draw_own: Draw) -> Report:
    run = read_run(folder)
    timing = read_timing(folder)
    workers = work(timing)
    confused = confusions(rows)
    grouped = members(settings(numbers.cells), numbers.cells)
    gap_summaries = gaps(rows)
    recognised = recognitions(rows)
    times = trial_times(timing)
    tables = {
        "cells": cell_table(numbers.cells),
        "pairs": pair_table(numbers.pairs),
        "half_levels": half_table(numbers.half_levels, numbers.areas),
        "areas": area_table(numbers.areas, numbers.area_differences),
        "area_differences": area_table((), numbers.area_differences),
        "gaps": gap_table(gap_summaries),
        "confusion": confusion_table(confused),
        "recognised": recognition_table(recognised),
        "calibration": calibration_table(calibrations(rows)),
        "felt": felt_table(felt(rows)),
        "effort": effort_table(efforts(rows)),
        "times": time_table(times),
        "work": work_table(workers),
    }
    wanted = [name for name in FILES if tables[name].items or name not in _IF_ANY]
    written = {name: tables[name].write_all(folder / TABLES / f"{name}.csv") for name in wanted}
    kept = {name: paths[0] for name, paths in written.items()}
    drawn = figures(numbers, grouped, gap_summaries, confused, recognised, times)
    paths = [drawing.write(folder / FIGURES / f"{name}.svg") for name, drawing in drawn.items()]
    small = [name for name in PNG if name in drawn and len(drawn[name].panels) <= MOST_PANELS]
    paths += [drawn[name].write(folder / FIGURES / f"{name}.png") for name in small]
    pictures, no_pictures = draw_own(rows, folder, scenario_files(run))
    beside = [path for both in written.values() for path in both]
    rows_kept = [folder / TABLES / ROWS] if has_parquet() else []
    sentences = answer(rows, numbers)
    html = report_page(
        name=folder.resolve().name,
        answer=sentences,
        rows=rows,
        summary=numbers,
        grouped=grouped,
        figures=drawn,
        tables=tables,
        run=run,
        work=workers,
        timed=len(timing),
        pictures=pictures,
        no_pictures=no_pictures,
        beside=[str(path.relative_to(folder)) for path in (*beside, *rows_kept, *paths)],
    )
    _remove_older(folder, {path.resolve() for path in (*beside, folder / TABLES / ROWS, *paths)})
    write_file(folder / PAGE, html)
    return Report(
        folder / PAGE, sentences, kept, tuple(paths), numbers.cells, confused, len(pictures), tuple(no_pictures)
    )


def _remove_older(folder: Path, written: Collection[Path]) -> None:
    """Remove what an earlier report wrote and this one did not, so that all tables and figures are of the same rows."""
    for path in (*(folder / TABLES).glob("*"), *(folder / FIGURES).glob("*")):
        ours = path.stem in OURS or path.stem.startswith("difference_to_")
        if ours and path.suffix in (".csv", ".parquet", ".svg", ".png") and path.resolve() not in written:
            path.unlink()


def _write_rows(rows: Sequence[Row], path: Path) -> None:
    """The rows themselves, what was predicted in columns of its own."""
    columns = {name: [row.get(name) for row in rows] for name in KEPT if name != "predicted"}
    predicted: list[Mapping[str, Any]] = [row.get("predicted") or {} for row in rows]
    columns |= {f"predicted_{key}": [said.get(key) for said in predicted] for key in ("fails", "operation", "code")}
    write_columns(list(columns), list(columns.values()), path)
