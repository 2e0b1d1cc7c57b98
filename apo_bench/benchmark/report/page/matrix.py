"""The matrix of a page, methods over noise levels, and the packed trials behind its cells.

A cell is a button that opens its trials.
"""

import base64
import gzip
import json
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from apo_bench.benchmark.analysis import (
    Condition,
    ConditionResult,
    format_noise,
    get_level,
    get_level_unit,
    group_by_condition,
    list_levels,
)
from apo_bench.benchmark.report.trial_text import NUMBERS, describe_failure, describe_prediction, describe_verdict
from apo_bench.geometry import Array
from apo_bench.io import group_by
from apo_bench.records import Limits, knows_truth
from apo_bench.records.run.replay_command import Files, format_command_without_seed
from apo_bench.records.run.trials import Trials

_DECIMALS = {"extra_steps": 0, "least_overlap": 2, "peak_force_n": 1, "sim_time_s": 1}
"""Decimals of numbers; others have three."""
_WORDS: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
    "verdict": describe_verdict,
    "why": describe_failure,
    "sentence": lambda row: row["sentence"] or "",
    "failure_prediction": describe_prediction,
}
"""Text of a trial -> function of its record."""
_NEEDED = (
    *("success", "as_demonstrated", "loose_success", "failure_stage", "failure_code", "failure_operation", "sentence"),
    *("predicted_fails", "predicted_operation", "predicted_code"),
)
"""Columns that these functions need."""
_MOST_LISTED = 100_000
"""Trials that a page lists, shared out over its cells; `trials.jsonl` has all."""
_FEWEST_LISTED = 100
"""Trials of a cell that a page always lists."""


class Button(NamedTuple):
    """A cell of the matrix, which opens its trials."""

    number: int
    """Its number among all cells of the page."""
    cell: ConditionResult
    span: int
    """Number of columns that it spans: more than one for the oracle, which noise does not affect."""


class Matrix(NamedTuple):
    """The matrix of one setting."""

    title: str
    corner: str  # text above the methods
    head: Sequence[str]
    """The noise levels."""
    lines: Sequence[tuple[str, Sequence[Button | None]]]
    """Methods with their cells; None for a level that was not run."""


def make_matrix(setting: Condition, cells: Sequence[ConditionResult], numbers: Mapping[Condition, int]) -> Matrix:
    """Arrange the cells of a setting by method and noise level.

    Args:
        numbers: Condition -> its number among all cells of the page.
    """
    levels = list_levels(cells)
    lines: list[tuple[str, list[Button | None]]] = []
    for method, own in group_by((c.method, c) for c in cells).items():
        by_level = {get_level(c): Button(numbers[c.condition], c, 1) for c in own}
        across = [by_level.get(level) for level in levels]
        if knows_truth(method):
            across = [Button(numbers[c.condition], c, max(1, len(levels))) for c in own]
        lines.append((method, across))
    corner = f"method, {get_level_unit(setting.noise)}" if levels else "method"
    return Matrix(setting.title, corner, [format_noise(x, setting.noise) for x in levels] or ["any"], lines)


def pack_trials(trials: Trials, files: Files, limits: Limits, pictures: Mapping[str, int]) -> str:
    """Pack the trials of all cells, or the first of each, for the script of the page: JSON, by gzip, as base64.

    Args:
        pictures: `cell:seed` -> number of the picture of that trial.
    """
    cells = group_by_condition(trials).values()
    most = max(_FEWEST_LISTED, _MOST_LISTED // max(1, len(cells)))
    columns: dict[str, list[Any]] = {name: [] for name in ("seed", *_WORDS, "command", *NUMBERS)}
    # texts repeat often, so each is kept once, and columns hold its number
    known: dict[str, dict[str, int]] = {name: {} for name in (*_WORDS, "command")}
    shown = [own.where(slice(most)) for own in cells]
    for own in shown:
        columns["seed"] += own.values("seed")
        for name in NUMBERS:
            columns[name] += _round_value(own.number(name), _DECIMALS.get(name, 3))
        # trials of a condition differ in nothing but the seed, and the limit that a lost trial exceeded
        first = own.where(slice(1)).rows()[0]
        commands = {
            lost: format_command_without_seed(first | {"failure_stage": lost}, files, limits)
            for lost in (None, "worker")
        }
        for row in own.rows(_NEEDED):
            said = {name: say(row) for name, say in _WORDS.items()}
            said["command"] = commands["worker" if row["failure_stage"] == "worker" else None]
            for name, text in said.items():
                columns[name].append(known[name].setdefault(text, len(known[name])))
    values = {
        "ends": np.cumsum([len(own) for own in shown]).tolist(),  # the end of each cell's trials in the columns
        "counts": [len(own) for own in cells],
        "words": {name: list(texts) for name, texts in known.items()},
        "numbers": [[name, label, _DECIMALS.get(name, 3)] for name, label in NUMBERS.items()],
        "columns": columns,
        "pictures": pictures,
    }
    text = json.dumps(values, separators=(",", ":"), allow_nan=False)
    return base64.b64encode(gzip.compress(text.encode(), compresslevel=6, mtime=0)).decode()


def _round_value(numbers: Array, decimals: int) -> list[float | int | None]:
    """Round numbers, (n,), as they are shown, with None for NaN; the script adds trailing zeros."""
    return [None if math.isnan(x) else int(x) if x == int(x) else x for x in np.round(numbers, decimals).tolist()]
