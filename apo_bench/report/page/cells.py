"""The cells of a page: a matrix of methods over levels for every setting, with a button for each cell, and the
trials of every cell, packed, to be unpacked by the script when a cell is opened."""

import base64
import gzip
import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from markupsafe import Markup

from apo_bench.records import SETTINGS, USUAL_LIMITS, Limits, Row, knows_truth, look_up
from apo_bench.records.run.replay_command import Files, without_seed
from apo_bench.records.run.report_rows import NUMBERS
from apo_bench.report.run.trials import verdict, why
from apo_bench.statistics import (
    Cell,
    Place,
    Setting,
    by_place,
    cell_place,
    level_of,
    level_unit,
    level_words,
    levels_of,
    percent,
    percents,
)

_MANY = 12
"""With more settings than this, those of a scenario are folded."""
_DECIMALS = {"extra_operations": 0, "least_overlap": 2, "peak_force_n": 1, "sim_seconds": 1}
"""Of numbers; of those in mm and degrees, and of others, three."""
_IN_COMMANDS = tuple(info.column for name, info in SETTINGS.items() if name not in ("seed", "salt"))
"""What commands of trials differ in, but for seeds and for what was lost."""


class Button(NamedTuple):
    """A cell that opens its trials."""

    number: int
    anchor: bool
    """A cell that stands in several matrices is met in the first."""
    rate: str
    lines: Sequence[str]
    title: str
    tip: str
    share: float
    span: int
    """Levels that it holds for: the oracle meets none, so it stands for all."""


class Matrix(NamedTuple):
    """Of one setting."""

    title: str
    corner: str
    head: Sequence[str]
    """The levels."""
    lines: Sequence[tuple[str, Sequence[Button | None]]]
    """Method, and its cells; None where a level was not run."""


def matrices(
    grouped: Mapping[Setting, Sequence[Cell]], numbers: Mapping[Place, int]
) -> list[tuple[str | None, list[Matrix]]]:
    """One per setting; where there are many, by scenario.

    Args:
        grouped: From `members`.
        numbers: Cell's place -> its number among all cells.
    """
    met: set[int] = set()
    folded: dict[str | None, list[Matrix]] = {}
    for setting, cells in grouped.items():
        scenario = setting.scenario if len(grouped) > _MANY else None
        folded.setdefault(scenario, []).append(_matrix(setting, cells, numbers, met))
    return list(folded.items())


def trials(
    rows: Iterable[Row],
    cells: Sequence[Cell],
    files: Files | None = None,
    pictured: Mapping[tuple[int, int], int] | None = None,
    limits: Limits = USUAL_LIMITS,
) -> dict[str, Any]:
    """What the script needs to show the trials of any cell, as plain values.

    Args:
        pictured: Number of the cell and seed -> number of the picture of that trial.
    """
    groups = by_place(rows)
    words: dict[str, dict[str, int]] = {
        name: {} for name in ("verdict", "why", "sentence", "predicted", "command")
    }  # texts that are said often: kept once, and by number
    columns: dict[str, list[Any]] = {name: [] for name in ("seed", *words, *NUMBERS)}
    ends = []
    commands: dict[tuple[Any, ...], str] = {}
    for cell in cells:
        for seed, row in sorted(groups[cell_place(cell)].items()):
            settings = (*(look_up(row, name) for name in _IN_COMMANDS), row.get("failure_stage") == "worker")
            if settings not in commands:
                commands[settings] = without_seed(row, files, limits)
            texts = {
                "verdict": verdict(row),
                "why": why(row),
                "sentence": row.get("sentence") or "",
                "predicted": _predicted(row.get("predicted")),
                "command": commands[settings],
            }
            columns["seed"].append(seed)
            for name, text in texts.items():
                columns[name].append(words[name].setdefault(text, len(words[name])))
            for name in NUMBERS:
                columns[name].append(_rounded(row.get(name), _DECIMALS.get(name, 3)))
        ends.append(len(columns["seed"]))
    return {
        "ends": ends,
        "words": {name: list(kept) for name, kept in words.items()},
        "numbers": [[name, label, _DECIMALS.get(name, 3)] for name, label in NUMBERS.items()],
        "columns": columns,
        "pictures": {f"{cell}:{seed}": k for (cell, seed), k in (pictured or {}).items()},
    }


def packed_json(values: Mapping[str, Any]) -> Markup:
    """Values as base64 of gzip of JSON: letters that mean nothing in HTML; equal bytes for equal values."""
    text = json.dumps(values, separators=(",", ":"), allow_nan=False).encode()
    return Markup(base64.b64encode(gzip.compress(text, compresslevel=6, mtime=0)).decode())


def _matrix(setting: Setting, cells: Sequence[Cell], numbers: Mapping[Place, int], met: set[int]) -> Matrix:
    levels = levels_of(cells)
    lines: list[tuple[str, list[Button | None]]] = []
    for method in dict.fromkeys(c.method for c in cells):
        own = {level_of(c): c for c in cells if c.method == method}
        if knows_truth(method):
            (best,) = own.values()
            lines.append((method, [_button(best, setting, numbers, met, max(1, len(levels)))]))
        else:
            by_level = [own.get(level) for level in levels]
            lines.append((method, [c and _button(c, setting, numbers, met) for c in by_level]))
    corner = f"method, {level_unit(setting.noise)}" if levels else "method"
    return Matrix(setting.title(), corner, [level_words(x, setting.noise) for x in levels] or ["any"], lines)


def _button(cell: Cell, setting: Setting, numbers: Mapping[Place, int], met: set[int], span: int = 1) -> Button:
    number = numbers[cell_place(cell)]
    level = "" if knows_truth(cell.method) else f", level {level_words(level_of(cell), cell.noise)}"
    title = f"{setting.title()}: {cell.method}{level}: {percent(cell.rate)}, {cell.successes} of {cell.trials}"
    anchor = number not in met
    met.add(number)
    lines = [percents(cell.interval), f"n {cell.trials}"]
    if cell.demonstrated != cell.successes:
        lines.append(f"as demonstrated: {percent(cell.demonstrated_rate)}")
    if cell.not_executed:
        done = cell.executed
        lines.append(f"executed: {percent(done.rate)}, n {done.trials}" if done.trials else "none executed")
    tip = f"{title}; 95 %: {percents(cell.interval)}; excluded {cell.excluded}"
    return Button(number, anchor, percent(cell.rate), lines, title, tip, cell.rate or 0.0, span)


def _predicted(forecast: Mapping[str, Any] | None) -> str:
    """What the plan said beforehand."""
    if forecast is None:
        return ""
    return f"operation {forecast['operation']} fails: {forecast['code']}" if forecast["fails"] else "fits"


def _rounded(x: Any, decimals: int) -> float | int | None:
    """A number as it is shown; the script writes the zeros at the end."""
    if x is None or isinstance(x, int):
        return x
    near = round(float(x), decimals)
    return int(near) if near == int(near) else near
