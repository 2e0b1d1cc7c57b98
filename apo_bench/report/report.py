"""The report of a sweep: one page that answers, tables and figures beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from apo_bench.errors import InputError
from apo_bench.io.csv_file import write_csv
from apo_bench.io.parquet import parquet_beside, write_columns
from apo_bench.io.writing import check_folders, check_target, to_write
from apo_bench.records.method import knows_truth
from apo_bench.records.run_file import read_run
from apo_bench.records.salt import check_one, one_salt, read_salt
from apo_bench.records.slim import COLUMNS as KEPT
from apo_bench.records.slim import slim_rows
from apo_bench.records.verdicts import by_verdict, verdict_of
from apo_bench.report.failures import Draw, Failures
from apo_bench.report.figures.figures import figures_of, methods_of, write_figures
from apo_bench.report.figures.gaps import gaps, write_gaps
from apo_bench.report.figures.levels import draw, rows_of
from apo_bench.report.figures.recognised import draw_recognitions
from apo_bench.report.figures.tightness import draw_tightness, varies
from apo_bench.report.figures.times import read_timing, times, write_times
from apo_bench.report.page.ran import scenario_files
from apo_bench.report.page.report_page import Found, report_page
from apo_bench.report.tables.confusion import write_confusions
from apo_bench.report.tables.halves import write_areas, write_halves
from apo_bench.report.tables.paired import write_paired
from apo_bench.report.tables.recognised import recognitions, write_recognitions
from apo_bench.statistics.confusion import Confusion, confusions
from apo_bench.statistics.rate_text import failures
from apo_bench.statistics.rates import Cell
from apo_bench.statistics.settings import members, settings
from apo_bench.statistics.summary import Summary, summary

COLUMNS = (
    *("scenario", "clearance_mm", "noise", "relations", "careless", "level_mm", "level_deg", "tightness", "method"),
    *("grasp", "fidelity", "trials", "successes", "rate", "low_95", "high_95", "executed", "executed_rate"),
    *(
        "executed_low_95",
        "executed_high_95",
        "as_demonstrated",
        "as_demonstrated_rate",
        "loose_successes",
        "loose_rate",
    ),
    *("excluded", "failures"),
)
MOST_PANELS = 16
"""Of a PNG; laying out more takes minutes."""
OURS = (
    *("recognised.csv", "recognised.parquet", "times.csv", "times.parquet", "recognised.png", "success_over_level.png"),
    *("success_over_tightness.png", "success_over_level.svg", "failure_stages.svg", "gap_before_and_after.svg"),
    *("prediction.svg", "timing.svg"),
)
"""Files that not every report has."""
PAGE, TABLES, FIGURES, ROWS = "report.html", "tables", "figures", "rows.parquet"


class Report(NamedTuple):
    """Where the report of a sweep was written."""

    page: Path
    table: Path
    """Cells: rates with their intervals."""
    paired: Path
    confusion: Path
    figure: Path | None
    """Success over level, as PNG; None of a sweep with more than `MOST_PANELS` panels, which has it as SVG alone."""
    tightness: Path | None
    """The figure over tightness; None where a sweep has one clearance per scenario."""
    recognised: tuple[Path, Path] | None
    """Table and figure of recognised contacts; None where a sweep was given all of them."""
    tables: tuple[Path, ...]
    """All, as CSV; beside each is the same as Parquet."""
    figures: tuple[Path, ...]
    """All that are drawn as SVG."""
    cells: tuple[Cell, ...]
    confusions: tuple[Confusion, ...]
    pictures: int
    """Failures that were drawn."""
    no_pictures: tuple[str, ...]
    """Why others were not."""
    verdict: str
    """What is counted as success: that, or `as_demonstrated` of older rows."""


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
    rows = slim_rows(folder)
    if not rows:
        raise InputError(f"'{folder}' holds no finished trial yet; run the sweep before its report.")
    salt = None if salt_file is None else read_salt(salt_file)
    if salt is not None:
        check_one(f"'{folder}'", salt.hash, one_salt(rows))
    verdict = verdict_of(rows, folder)
    counted = by_verdict(rows, verdict)
    found = summary(counted)
    if not found.cells:
        raise InputError(
            f"'{folder}' holds replays of measured demonstrations alone, which belong to no cell of a sweep."
        )
    try:
        check_target(folder / PAGE)
        check_folders(folder / name for name in (TABLES, FIGURES))
        for name in (TABLES, FIGURES):
            (folder / name).mkdir(exist_ok=True)
        _remove_older(folder)
        failed = Failures(pictures if draw else 0, draw, salt, trust_code)
        made = _written(folder, counted, verdict, found, failed)
        _rows(rows, folder / TABLES / ROWS)
        return made
    except OSError as error:
        raise InputError(f"'{folder}' cannot be written ({error.strerror}); copy it to a place that can.") from error


def _written(
    folder: Path,
    rows: Sequence[Mapping[str, Any]],
    verdict: str,
    found: Summary,
    failed: Failures,
) -> Report:
    run, timing = read_run(folder), read_timing(folder)
    files, told, wrong = scenario_files(run), recognitions(rows), confusions(rows)
    gap, took = gaps(rows), times(timing)
    grouped = members(settings(found.cells), found.cells)
    figures = figures_of(found, grouped, gap, wrong, took)
    drawn = _drawn(folder / FIGURES, found.cells, told)
    tables = _tables(folder / TABLES, found, told)
    write_gaps(gap, tables.setdefault("gaps", folder / TABLES / "gaps.csv"))
    write_confusions(wrong, tables.setdefault("confusion", folder / TABLES / "confusion.csv"))
    if took:
        write_times(took, tables.setdefault("times", folder / TABLES / "times.csv"))
    made = [path for table in tables.values() for path in (table, parquet_beside(table))]
    made.append(folder / TABLES / ROWS)
    svg = write_figures(figures, methods_of(found.cells), folder / FIGURES)
    taken, missed = failed.drawn(rows, folder, files)
    page = Found(
        name=folder.resolve().name,
        verdict=verdict,
        rows=rows,
        summary=found,
        grouped=grouped,
        figures=figures,
        gaps=gap,
        confusions=wrong,
        recognitions=told,
        timing=timing,
        run=run,
        files=files,
        pictures=taken,
        no_pictures=missed,
        drawn=drawn,
        tables=[str(path.relative_to(folder)) for path in (*made, *drawn.values(), *svg)],
    )
    with to_write(folder / PAGE, "w") as file:
        file.write(report_page(page))
    recognised = (tables["recognised"], drawn["recognised"]) if told else None
    return Report(
        page=folder / PAGE,
        table=tables["cells"],
        paired=tables["pairs"],
        confusion=tables["confusion"],
        figure=drawn.get("success_over_level"),
        tightness=drawn.get("success_over_tightness"),
        recognised=recognised,
        tables=tuple(tables.values()),
        figures=tuple(svg),
        cells=found.cells,
        confusions=wrong,
        pictures=len(taken),
        no_pictures=tuple(missed),
        verdict=verdict,
    )


def _remove_older(folder: Path) -> None:
    """What an earlier report wrote and this one may not: nothing beside the page shall be of other rows."""
    for path in (*(folder / TABLES).glob("*"), *(folder / FIGURES).glob("*")):
        if path.name in OURS or (path.name.startswith("difference_to_") and path.suffix == ".svg"):
            path.unlink()


def _drawn(folder: Path, cells: Sequence[Cell], told: Sequence[Any]) -> dict[str, Path]:
    """Figures as PNG."""
    made: dict[str, Path] = {}
    few = len(rows_of(cells)) * len({c.careless for c in cells if not knows_truth(c.method)}) <= MOST_PANELS
    if few:
        made["success_over_level"] = folder / "success_over_level.png"
        draw(cells, made["success_over_level"])
    if few and varies(cells):
        made["success_over_tightness"] = folder / "success_over_tightness.png"
        draw_tightness(cells, made["success_over_tightness"])
    if told:
        made["recognised"] = folder / "recognised.png"
        draw_recognitions(told, made["recognised"])
    return made


def _tables(folder: Path, found: Summary, told: Sequence[Any]) -> dict[str, Path]:
    names = ("cells", "pairs", "half_levels", "areas", *(("recognised",) if told else ()))
    made = {name: folder / f"{name}.csv" for name in names}
    _write_cells(found.cells, made["cells"])
    write_paired(found.pairs, made["pairs"])
    write_halves(found.half_levels, made["half_levels"])
    write_areas(found.areas, found.area_differences, made["areas"])
    if told:
        write_recognitions(told, made["recognised"])
    return made


def _write_cells(cells: Sequence[Cell], path: Path) -> None:
    write_csv(path, COLUMNS, (_line(cell) for cell in cells))


def _line(c: Cell) -> tuple[object, ...]:
    where = (c.scenario, c.clearance_mm, c.noise, c.relations, c.careless, c.level, c.level_deg, c.tightness, c.method)
    strict = (c.grasp, c.fidelity, c.trials, c.successes, c.rate, *c.interval)
    executed = (c.executed.trials, c.executed.rate, *c.executed.interval)
    other = (c.demonstrated, c.demonstrated_rate, c.loose_successes, c.loose_rate, c.excluded)
    return (*where, *strict, *executed, *other, failures(c, 99))


def _rows(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """The rows themselves, what was predicted in columns of its own."""
    plain = [name for name in KEPT if name != "predicted"]
    columns = [[row.get(name) for row in rows] for name in plain]
    said = ("fails", "operation", "code")
    foretold = [[None if (p := row.get("predicted")) is None else p[key] for row in rows] for key in said]
    write_columns([*plain, *(f"predicted_{key}" for key in said)], [*columns, *foretold], path)
