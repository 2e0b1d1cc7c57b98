"""Write the report of a sweep: page, tables and figures."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from apo_bench.benchmark.analysis import (
    ConditionResult,
    Line,
    Summary,
    list_settings,
    read_timing,
    summarise,
    tabulate_calibration,
    tabulate_confusion,
    tabulate_detection,
    tabulate_effort,
    tabulate_gaps,
    tabulate_probing,
    tabulate_timing,
)
from apo_bench.benchmark.report.conclusions import write_answer
from apo_bench.benchmark.report.failure_choice import Draw, choose_failures
from apo_bench.benchmark.report.figures.figures import draw_figures
from apo_bench.benchmark.report.page.report_page import Contents, render_report
from apo_bench.benchmark.report.tables.conditions import make_condition_table, make_half_level_table, make_pair_table
from apo_bench.benchmark.report.tables.methods import (
    make_calibration_table,
    make_confusion_table,
    make_detection_table,
    make_effort_table,
    make_gap_table,
    make_probing_table,
    make_time_table,
    make_work_table,
)
from apo_bench.errors import InputError, require
from apo_bench.io import check_target, has_parquet, write_file, write_parts
from apo_bench.records import TrialRecord
from apo_bench.records.run.run_file import list_scenario_files, read_run
from apo_bench.records.run.trial_reader import read_trials
from apo_bench.records.run.trials import COLUMNS, Trials

MOST_PANELS = 16
"""Most panels of a figure that is also drawn as PNG; more would take minutes."""
PNG = ("success_over_noise_level", "success_over_tightness", "success_over_reobservations", "detected")
"""Figures that are also written as PNG."""
FILES = ("conditions", "pairs", "half_levels", "detected", "gaps", "confusion", "probing", "times")
"""Tables that are also written as files; those of `_IF_ANY` only if they have a line."""
_IF_ANY = ("detected", "probing", "times")
_OURS = (*FILES, *PNG, "records", "failure_stages", "gap_before_and_after", "prediction", "timing")
"""Names of tables and figures of a report, without endings; `difference_to_..` is one as well."""
_PART = 100_000  # records in a part of the Parquet file
PAGE = "report.html"
TABLES = "tables"
FIGURES = "figures"


class Report(NamedTuple):
    """The files of a written report, and its main results."""

    page: Path
    answer: str
    """Some sentences, with methods in backquotes."""
    tables: Mapping[str, Path]
    """Name of each table -> its CSV file; with the package pyarrow there is also a Parquet file."""
    figures: tuple[Path, ...]
    """Paths of the figures: SVG, some also PNG."""
    conditions: tuple[ConditionResult, ...]
    confusions: Sequence[Line]
    pictures: int
    """Number of failures that were drawn."""
    no_pictures: tuple[str, ...]
    """Why other failures were not drawn."""


def write_report(folder: str | Path, pictures: int = 0, draw: Draw | None = None) -> Report:
    """Write page, tables and figures into the folder of a sweep; no code that its records name is imported.

    Args:
        pictures: Largest number of failures to draw.
        draw: Draws failures; None draws none.

    Raises:
        InputError: The folder has no records, or cannot be written.
    """
    folder = Path(folder)
    trials = read_trials(folder)
    require(len(trials), f"'{folder}' holds no finished trial yet; run the sweep before its report.")
    numbers = summarise(trials)
    require(
        numbers.results,
        f"'{folder}' holds only replays of observations from files, which belong to no condition of a sweep.",
    )
    try:
        check_target(folder / PAGE)
        for name in (TABLES, FIGURES):
            require(not (folder / name).is_symlink(), f"{folder / name} is a symbolic link; remove it.")
            (folder / name).mkdir(exist_ok=True)
        return _write_files(folder, trials, numbers, choose_failures(trials, pictures), draw)
    except OSError as error:
        raise InputError(f"'{folder}' cannot be written ({error.strerror}); copy it to a place that can.") from error


def _write_files(
    folder: Path, trials: Trials, numbers: Summary, failures: Sequence[TrialRecord], draw: Draw | None
) -> Report:
    """Compute all tables and figures, and write them."""
    run = read_run(folder)
    times, work = tabulate_timing(read_timing(folder))
    tables = {
        "conditions": make_condition_table(numbers.results),
        "pairs": make_pair_table(numbers.pairs),
        "half_levels": make_half_level_table(numbers.half_levels),
        "gaps": make_gap_table(tabulate_gaps(trials)),
        "confusion": make_confusion_table(tabulate_confusion(trials)),
        "detected": make_detection_table(tabulate_detection(trials)),
        "calibration": make_calibration_table(tabulate_calibration(trials)),
        "probing": make_probing_table(tabulate_probing(trials)),
        "effort": make_effort_table(tabulate_effort(trials)),
        "times": make_time_table(times),
        "work": make_work_table(work),
    }
    lines = (tables[name].items for name in ("gaps", "confusion", "detected", "times"))  # for the figures
    drawn = draw_figures(numbers.results, numbers.pairs, list_settings(numbers.results), *lines)
    wanted = [name for name in FILES if tables[name].items or name not in _IF_ANY]
    written = {name: tables[name].write(folder / TABLES / f"{name}.csv") for name in wanted}
    kept = [path for paths in written.values() for path in paths]
    if has_parquet():
        kept.append(_write_rows(trials, folder / TABLES / "records.parquet"))
    paths = [figure.write(folder / FIGURES / f"{name}.svg") for name, figure in drawn.items()]
    small = [name for name in PNG if name in drawn and drawn[name].panels <= MOST_PANELS]
    paths += [drawn[name].write(folder / FIGURES / f"{name}.png") for name in small]
    pictures, no_pictures = draw(failures, folder, list_scenario_files(run)) if draw else ([], [])
    sentences = write_answer(trials, numbers.half_levels)
    html = render_report(
        Contents(
            name=folder.resolve().name,
            answer=sentences,
            trials=trials,
            results=numbers.results,
            figures=drawn,
            tables=tables,
            run=run,
            pictures=pictures,
            no_pictures=no_pictures,
            beside=[str(path.relative_to(folder)) for path in (*kept, *paths)],
        )
    )
    _remove_older(folder, {path.resolve() for path in (*kept, *paths)})  # before the page, which only links new files
    write_file(folder / PAGE, html)
    csv = {name: paths[0] for name, paths in written.items()}
    confused = tables["confusion"].items
    return Report(
        folder / PAGE, sentences, csv, tuple(paths), numbers.results, confused, len(pictures), tuple(no_pictures)
    )


def _remove_older(folder: Path, written: Collection[Path]) -> None:
    """Remove files of an earlier report that this one did not write, so that all files show the same records."""
    for path in (*(folder / TABLES).glob("*"), *(folder / FIGURES).glob("*")):
        ours = path.stem in _OURS or path.stem.startswith("difference_to_")
        if ours and path.suffix in (".csv", ".parquet", ".svg", ".png") and path.resolve() not in written:
            path.unlink()


def _write_rows(trials: Trials, path: Path) -> Path:
    """Write the trials as Parquet, with the failure prediction in columns of its own."""
    distinct = {name: trials.coded(name).names for name, kind in COLUMNS.items() if kind is None}
    starts = range(0, len(trials), _PART)
    parts = (_values(trials.where(slice(start, start + _PART))) for start in starts)
    write_parts(COLUMNS, distinct, parts, path)
    return path


def _values(trials: Trials) -> dict[str, Any]:
    """Return the numbers of each column as masked arrays, and the codes of the others."""
    return {
        name: trials.coded(name).codes
        if kind is None
        else np.ma.masked_array(np.nan_to_num(trials.number(name)).astype(kind), trials.is_null(name))
        for name, kind in COLUMNS.items()
    }
