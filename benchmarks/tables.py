"""Write docs/results/tables.md from the rows that are kept: `python benchmarks/tables.py`."""

from __future__ import annotations

import gzip
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING
from pathlib import Path
from typing import Any

from apo_bench.records import ROW_FIELDS, SETTINGS
from apo_bench.report.tables.methods import calibration_table, confusion_table
from apo_bench.statistics import Cell, calibrations, confusions, tally
from apo_bench.statistics.paired import paired

ROOT = Path(__file__).parents[1]
ROWS = ROOT / "benchmarks" / "results" / "rows.jsonl.gz"
PAGE = ROOT / "docs" / "results" / "tables.md"

ABLATIONS = ("last-only", "no-history", "no-disappeared")
BASELINES = ("none", "snap", "settle", "penalty", "least-squares", "paper", "contact")
TOLD = ("given", "recognised", "recognised-fixed", "recognised-twice")
WRONG = ("missed", "false", "shifted")
MAIN = ("oracle", "none", "paper", "paper-track", "contact")

Row = Mapping[str, Any]


def main() -> None:
    rows = unpacked(ROWS)
    cells = [cell for cell in tally(rows) if cell.careless == 1.0 or cell.method == "oracle"]
    plain = [cell for cell in cells if (cell.noise, cell.relations) == ("isotropic", "given")]
    known = [row for row in rows if row["p_value"] is not None or row["planned_error_free_mm"] is not None]
    calibrated = calibration_table([c for c in calibrations(known) if c.method.startswith("contact")])
    confused = confusion_table(confusions(rows))
    lines = [
        "# Tables of earlier sweeps",
        "",
        f"{len(rows)} trials, written by `python benchmarks/tables.py` from `benchmarks/results/rows.jsonl.gz`. Strict "
        "success, friction grasp, 0.25 mm clearance per side, careless humans (carelessness 1), MuJoCo 3.17.0, 1 ms. A "
        "level of L is a standard deviation of L mm and L degrees per axis. Seeds count from 0 and are the same for "
        "every method; numbers differ where sweeps were stopped for lack of time.",
        "",
        "## Noise that is the same in every direction",
        "",
        *crossed(plain, MAIN, lambda cell: (cell.scenario, f"{cell.level:g}")),
        "",
        "## Noise that is not",
        "",
        "`anisotropic` and `camera` are worse along a line of sight, `per-part` differs from part to part, "
        "`megapose-tless-inliers` and `megapose-lmo-inliers` were measured, level 1 as measured "
        "([how](../guide/noise.md)), as the files of version 0.1.0 said it before turned estimates were left out; "
        "the others: [noise models](../reference/noise-models.md).",
        "",
        *crossed(
            [c for c in cells if c.noise not in ("isotropic", "range") and c.relations == "given"],
            ("none", "paper", "contact"),
            lambda cell: (cell.scenario, cell.noise, f"{cell.level:g}"),
            ("scenario", "noise", "level"),
        ),
        "",
        "## Poses measured by a range finder",
        "",
        "Depth images with a noise of so many mm per ray ([depth camera](../how/depth-camera.md)).",
        "",
        *crossed(
            [c for c in cells if c.noise == "range" and c.relations == "given"],
            ("none", "contact"),
            lambda cell: (cell.scenario, f"{cell.level:g}"),
        ),
        "",
        "## Recognised contacts",
        "",
        "`contact`, told of the contacts as they are or as they were recognised ([how](../how/recognition.md)); on "
        "the same seeds.",
        "",
        *told(rows),
        "",
        "## `contact` against `paper`, seed by seed",
        "",
        "Difference of success rates in points with Tango's score interval for paired proportions (with no discordant "
        "pair it still reaches 384 / (n + 3.84) points to both sides), and mean difference of the errors of planned "
        "goals along free directions with Student's t interval, where rows hold it; all 95 %.",
        "",
        *pairs(rows),
        "",
        "## Baselines at level 2",
        "",
        *crossed(
            [cell for cell in plain if cell.level == 2.0], BASELINES, lambda cell: (cell.scenario,), ("scenario",)
        ),
        "",
        "Tuned on other seeds by `python benchmarks/tune.py`. `least-squares` minimises almost the same cost as "
        "`contact` and wins as often; what it lacks is an exact solution, its rank, its test and its speed "
        "([contact](../how/contact.md)).",
        "",
        "## Wrong relations",
        "",
        "Level 1. `missed`: one contact is not told; `false`: one too many; `shifted:5`: one plane is 5 mm off.",
        "",
        *crossed(
            [cell for cell in cells if cell.relations.split(":")[0] in WRONG],
            ("paper", "contact", "contact-refuse", "contact-drop"),
            lambda cell: (cell.scenario, cell.relations),
            ("scenario", "relations"),
        ),
        "",
        "## Without history",
        "",
        *crossed(plain, ABLATIONS, lambda cell: (cell.scenario, f"{cell.level:g}")),
        "",
        "## Calibration",
        "",
        calibrated.note,
        "",
        *calibrated.markdown(),
        "",
        "## Prediction and physics",
        "",
        confused.note,
        "",
        *confused.markdown(),
    ]
    PAGE.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"Wrote {PAGE}")


def unpacked(packed: Path) -> list[dict[str, Any]]:
    """The rows, with what they do not hold as null or as usual; the one verdict of then is both verdicts of today."""
    usual = {info.column: info.default for info in SETTINGS.values() if info.default is not MISSING}
    rows = []
    with gzip.open(packed) as source:
        for line in source:
            row = dict.fromkeys(ROW_FIELDS) | usual | json.loads(line)
            rows.append(row | {"as_demonstrated": row["success"]})
    return rows


def crossed(
    cells: Iterable[Cell],
    methods: Sequence[str],
    key: Callable[[Cell], tuple[str, ...]],
    header: Sequence[str] = ("scenario", "level"),
) -> list[str]:
    """One line per key, one column per method: `99 of 100`."""
    table: dict[tuple[str, ...], dict[str, Cell]] = {}
    for cell in cells:
        if cell.method in methods:
            table.setdefault(key(cell), {})[cell.method] = cell
    return [
        f"| {' | '.join((*header, *(f'`{m}`' for m in methods)))} |",
        "|" + "---|" * (len(header) + len(methods)),
        *(f"| {' | '.join((*k, *(counted(found.get(m)) for m in methods)))} |" for k, found in table.items()),
    ]


def told(rows: Sequence[Row]) -> list[str]:
    """Successes of `contact` by what it was told, over the seeds for which there are recognised contacts."""
    known = [row for row in rows if row["method"] == "contact" and row["relations"] in TOLD]
    places = {(*_place(row), row["seed"]) for row in known if row["relations"] == "recognised"}
    table: dict[tuple[Any, ...], dict[str, list[bool]]] = {}
    for row in known:
        if (*_place(row), row["seed"]) in places:
            table.setdefault(_place(row), {}).setdefault(row["relations"], []).append(bool(row["success"]))
    return [
        f"| scenario | noise | careless | level | {' | '.join(f'`{name}`' for name in TOLD)} |",
        "|" + "---|" * (4 + len(TOLD)),
        *(
            f"| {' | '.join(map(str, place))} | "
            + " | ".join(f"{sum(found[n])} of {len(found[n])}" if n in found else "" for n in TOLD)
            + " |"
            for place, found in sorted(table.items())
        ),
    ]


def _place(row: Row) -> tuple[Any, ...]:
    return row["scenario"], row["noise"], f"{row['careless']:g}", f"{row['level']:g}"


def counted(cell: Cell | None) -> str:
    return f"{cell.successes} of {cell.trials}" if cell else ""


def pairs(rows: Sequence[Row]) -> list[str]:
    lines = [
        "| scenario | noise | level | pairs | only `contact` | only `paper` | difference | free error, difference |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for p in paired(rows, ("paper",)):
        if p.place.method == "contact" and p.place.relations == "given":
            low, high = p.interval
            free = "" if p.free_mm is None else f"{p.free_mm:+.2f} mm"
            if p.free_interval is not None:
                free += f" ({p.free_interval.low:+.2f} to {p.free_interval.high:+.2f}, n = {p.planned})"
            points = f"{100 * (p.difference or 0.0):+.1f} ({100 * low:+.1f} to {100 * high:+.1f})"
            where = f"| {p.place.scenario} | {p.place.noise} | {p.place.level:g} "
            lines.append(f"{where}| {p.pairs} | {p.only_method} | {p.only_reference} | {points} | {free} |")
    return lines


if __name__ == "__main__":
    main()
