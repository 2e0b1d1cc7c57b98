"""The cells of a page: a matrix of methods over levels for every setting, with a button for each cell, and the
trials of every cell, packed, to be unpacked by the script when a cell is opened."""

import base64
import gzip
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup

from apo_bench.io import grouped
from apo_bench.records import USUAL_LIMITS, Limits, Row, knows_truth
from apo_bench.records.run.replay_command import Files, without_seed
from apo_bench.records.run.run_folder import NUMBERS
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
    by_setting: Mapping[Setting, Sequence[Cell]], numbers: Mapping[Place, int]
) -> list[tuple[str | None, list[Matrix]]]:
    """One per setting; where there are many, by scenario.

    Args:
        by_setting: From `members`.
        numbers: Cell's place -> its number among all cells.
    """
    met: set[int] = set()
    many = len(by_setting) > _MANY
    all_matrices = ((s.scenario if many else None, _matrix(s, own, numbers, met)) for s, own in by_setting.items())
    return list(grouped(all_matrices).items())


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
    by_cell = [sorted(groups[cell_place(cell)].items()) for cell in cells]
    shown = [row for own in by_cell for _, row in own]
    texts: dict[str, Callable[[Row], str]] = {
        "verdict": verdict,
        "why": why,
        "sentence": lambda row: row.get("sentence") or "",
        "predicted": _predicted,
        "command": lambda row: without_seed(row, files, limits),
    }
    words = {}  # texts that are said often: kept once, and by number
    columns: dict[str, list[Any]] = {"seed": [seed for own in by_cell for seed, _ in own]}
    for name, text in texts.items():
        numbers: dict[str, int] = {}
        columns[name] = [numbers.setdefault(text(row), len(numbers)) for row in shown]
        words[name] = list(numbers)
    places = {name: _DECIMALS.get(name, 3) for name in NUMBERS}
    return {
        "ends": np.cumsum([len(own) for own in by_cell]).tolist(),
        "words": words,
        "numbers": [[name, label, places[name]] for name, label in NUMBERS.items()],
        "columns": columns | {name: [_rounded(row.get(name), places[name]) for row in shown] for name in NUMBERS},
        "pictures": {f"{cell}:{seed}": k for (cell, seed), k in (pictured or {}).items()},
    }


def packed_json(values: Mapping[str, Any]) -> Markup:
    """Values as base64 of gzip of JSON: letters that mean nothing in HTML; equal bytes for equal values."""
    return Markup(
        base64.b64encode(
            gzip.compress(json.dumps(values, separators=(",", ":"), allow_nan=False).encode(), compresslevel=6, mtime=0)
        ).decode()
    )


def _matrix(setting: Setting, cells: Sequence[Cell], numbers: Mapping[Place, int], met: set[int]) -> Matrix:
    levels = levels_of(cells)
    lines: list[tuple[str, list[Button | None]]] = []
    for method, own in grouped((c.method, c) for c in cells).items():
        by_level = {level_of(c): c for c in own}
        across = own if knows_truth(method) else [by_level.get(level) for level in levels]
        span = max(1, len(levels)) if knows_truth(method) else 1
        lines.append((method, [c and _button(c, setting, numbers, met, span) for c in across]))
    corner = f"method, {level_unit(setting.noise)}" if levels else "method"
    return Matrix(setting.title(), corner, [level_words(x, setting.noise) for x in levels] or ["any"], lines)


def _button(cell: Cell, setting: Setting, numbers: Mapping[Place, int], met: set[int], span: int) -> Button:
    number = numbers[cell_place(cell)]
    level = "" if knows_truth(cell.method) else f", level {level_words(level_of(cell), cell.noise)}"
    title = f"{setting.title()}: {cell.method}{level}: {percent(cell.rate)}, {cell.successes} of {cell.trials}"
    anchor = number not in met
    met.add(number)
    done = cell.executed
    executed = f"executed: {percent(done.rate)}, n {done.trials}" if done.trials else "none executed"
    lines = (
        percents(cell.interval),
        f"n {cell.trials}",
        *[f"as demonstrated: {percent(cell.demonstrated_rate)}"] * (cell.demonstrated != cell.successes),
        *[executed] * (cell.not_executed > 0),
    )
    tip = f"{title}; 95 %: {percents(cell.interval)}; excluded {cell.excluded}"
    return Button(number, anchor, percent(cell.rate), lines, title, tip, cell.rate or 0.0, span)


def _predicted(row: Row) -> str:
    """What the plan said beforehand."""
    forecast = row.get("predicted")
    if forecast is None:
        return ""
    return f"operation {forecast['operation']} fails: {forecast['code']}" if forecast["fails"] else "fits"


def _rounded(x: Any, decimals: int) -> float | int | None:
    """A number as it is shown; the script writes the zeros at the end."""
    if x is None or isinstance(x, int):
        return x
    near = round(float(x), decimals)
    return int(near) if near == int(near) else near
