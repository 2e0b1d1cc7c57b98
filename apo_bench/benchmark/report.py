"""The report of a sweep: a table, a figure, and a page that shows both."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from apo_bench.benchmark.calibration import WORDS as CALIBRATION
from apo_bench.benchmark.calibration import calibration_lines, calibrations
from apo_bench.benchmark.confusion import confusions
from apo_bench.benchmark.confusion_table import WORDS, confusion_lines, write_confusions
from apo_bench.benchmark.effort import WORDS as EFFORT
from apo_bench.benchmark.effort import effort_lines, efforts
from apo_bench.benchmark.figure import draw, level_label
from apo_bench.benchmark.figure_tightness import draw_tightness, varies
from apo_bench.benchmark.journal import read_rows
from apo_bench.benchmark.paired import paired
from apo_bench.benchmark.paired_table import WORDS as PAIRED
from apo_bench.benchmark.paired_table import paired_lines, write_paired
from apo_bench.benchmark.recognised_picture import draw_recognitions
from apo_bench.benchmark.recognised_table import WORDS as RECOGNISED
from apo_bench.benchmark.recognised_table import recognition_lines, recognitions, write_recognitions
from apo_bench.benchmark.spec import RANGE, knows_relations
from apo_bench.benchmark.statistics import Cell, tally
from apo_bench.errors import InputError

COLUMNS = (
    *("scenario", "clearance_mm", "noise", "relations", "careless", "level_mm", "level_deg", "tightness", "method"),
    *("trials", "successes", "rate", "low_95", "high_95", "loose_successes", "loose_rate", "excluded", "failures"),
)


class Report(NamedTuple):
    """Where the report of a sweep was written."""

    table: Path
    figure: Path
    page: Path
    confusion: Path
    paired: Path
    tightness: Path | None
    """The figure over tightness; None where a sweep has one clearance per scenario."""
    recognised: tuple[Path, Path] | None = None
    """Table and figure of recognised contacts; None where a sweep was given all of them."""


def report(folder: str | Path) -> Report:
    """Write tables, figures and the page that shows them beside the rows of a sweep.

    Raises:
        InputError: No rows there, or the folder cannot be written.
    """
    folder = Path(folder)
    rows = read_rows(folder)
    if not rows:
        raise InputError(f"'{folder}' holds no finished trial yet; run the sweep before its report.")
    cells = tally(rows)
    made = Report(
        table=folder / "table.csv",
        figure=folder / "success_over_level.png",
        page=folder / "report.md",
        confusion=folder / "confusion.csv",
        paired=folder / "paired.csv",
        tightness=folder / "success_over_tightness.png" if varies(cells) else None,
        recognised=(folder / "recognised.csv", folder / "recognised.png") if recognitions(rows) else None,
    )
    try:
        _write_table(cells, made.table)
        write_confusions(confusions(rows), made.confusion)
        write_paired(paired(rows), made.paired)
        draw(cells, made.figure)
        if made.tightness is not None:
            draw_tightness(cells, made.tightness)
        if made.recognised is not None:
            write_recognitions(recognitions(rows), made.recognised[0])
            draw_recognitions(recognitions(rows), made.recognised[1])
        made.page.write_text(_page(rows, cells, made), encoding="utf-8")
    except OSError as error:
        raise InputError(f"'{folder}' cannot be written ({error.strerror}); copy it to a place that can.") from error
    return made


def percent(rate: float | None) -> str:
    """`97.0 %`, or a dash where nothing counted."""
    return "–" if rate is None else f"{100 * rate:.1f} %"


def interval(cell: Cell) -> str:
    """`91.5 to 99.0 %`."""
    low, high = cell.interval
    return f"{100 * low:.1f} to {100 * high:.1f} %"


def failures(cell: Cell, most: int = 3) -> str:
    """`attach: force_stop 12, judge: gap 3`: the most frequent endings of trials that failed."""
    return ", ".join(f"{why} {count}" for why, count in list(cell.failures.items())[:most])


def _write_table(cells: Sequence[Cell], path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for c in cells:
            where = (c.scenario, c.clearance_mm, c.noise, c.relations, c.careless, c.level, c.level_deg)
            loose = (c.loose_successes, c.loose_rate)
            writer.writerow(
                [
                    *where,
                    c.tightness,
                    c.method,
                    c.trials,
                    c.successes,
                    c.rate,
                    *c.interval,
                    *loose,
                    c.excluded,
                    failures(c, 99),
                ]
            )


def _page(rows: Sequence[Mapping[str, Any]], cells: Sequence[Cell], made: Report) -> str:
    excluded = {(r["scenario"], r["seed"], r["careless"]) for r in rows if r["demonstration"] != "ok"}
    shown = {(r["scenario"], r["seed"], r["careless"]) for r in rows}
    grasps = ", ".join(sorted({r["grasp"] for r in rows}))
    lines = [
        "# Success of replayed demonstrations",
        "",
        f"{len(rows)} trials; grasp {grasps}. {_level(rows)}",
        "`oracle` replays the drawn layout and meets neither noise nor carelessness; `none` replays what was seen. "
        "Neither is told what touches what, so wrong relations are met by correctors alone.",
        f"{len(excluded)} of {len(shown)} demonstrations were not right themselves and are left out of every method.",
        "",
        f"![Success over level]({made.figure.name})",
        "",
        *([] if made.tightness is None else [f"![Success over tightness]({made.tightness.name})", ""]),
        "| scenario | clearance | noise | relations | careless | level | method | strict success | 95 % interval | n "
        "| excluded | loose | failures |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|",
        *(_line(cell) for cell in cells),
        "",
        "Strict and loose are the judge's; intervals are Wilson's; the same numbers stand in "
        f"[{made.table.name}]({made.table.name}). Excluded are trials whose demonstration was not right.",
        "",
        "## Pairs",
        "",
        PAIRED,
        "",
        *paired_lines(paired(rows)),
        "",
        "## Prediction and physics",
        "",
        WORDS,
        "",
        *confusion_lines(confusions(rows)),
        "",
        "## What it takes",
        "",
        EFFORT,
        "",
        *effort_lines(efforts(rows)),
        "",
        "## Calibration",
        "",
        CALIBRATION,
        "",
        *calibration_lines(calibrations(rows)),
        *_recognised(rows, made),
    ]
    return "\n".join(lines) + "\n"


def _level(rows: Sequence[Mapping[str, Any]]) -> str:
    """What a level is, for the eyes that looked."""
    noises = {row["noise"] for row in rows}
    if noises == {RANGE}:
        return "A level of L is a standard deviation of L mm per ray of the range finder."
    also = "; seen by the range finder (noise `range`), of L mm per ray" if RANGE in noises else ""
    return (
        "A level of L is a standard deviation of L mm and L degrees per axis, times what the noise model makes of it "
        f"in a direction or for a part{also}."
    )


def _recognised(rows: Sequence[Mapping[str, Any]], made: Report) -> list[str]:
    """The section on recognised contacts; nothing where all were given."""
    if made.recognised is None:
        return []
    table, figure = (path.name for path in made.recognised)
    words = f"{RECOGNISED} The same numbers stand in [{table}]({table})."
    lines = recognition_lines(recognitions(rows))
    return ["", "## Recognised contacts", "", words, "", f"![Recognised contacts]({figure})", "", *lines]


def _line(c: Cell) -> str:
    ceiling = c.method == "oracle"
    noise, relations = "any" if ceiling else c.noise, c.relations if knows_relations(c.method) else "any"
    return (
        f"| {c.scenario} | {c.clearance_mm:g} mm | {noise} | {relations} | {'any' if ceiling else f'{c.careless:g}'} "
        f"| {'any' if ceiling else level_label(c.level, c.level_deg, c.noise)} | {c.method} | {percent(c.rate)} "
        f"| {interval(c)} | {c.trials} | {c.excluded} | {percent(c.loose_rate)} | {failures(c)} |"
    )
