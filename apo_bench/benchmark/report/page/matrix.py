"""The matrix of a page, methods over noise levels, and the packed trials behind its cells.

A cell is a button that opens its trials.
"""

import base64
import gzip
import json
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
from apo_bench.benchmark.report.trial_text import NUMBERS, predicted, verdict, why
from apo_bench.io import group_by
from apo_bench.records import Limits, knows_truth
from apo_bench.records.run.replay_command import Files, without_seed
from apo_bench.records.run.trials import Trials

_DECIMALS = {"extra_steps": 0, "least_overlap": 2, "peak_force_n": 1, "sim_time_s": 1}
"""Decimals of numbers; others have three."""


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


def matrix(setting: Condition, cells: Sequence[ConditionResult], numbers: Mapping[Condition, int]) -> Matrix:
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
    """Pack the trials of all cells for the script of the page: JSON, compressed by gzip, as base64.

    Args:
        pictures: `cell:seed` -> number of the picture of that trial.
    """
    cells = group_by_condition(trials).values()
    words: dict[str, Callable[[Mapping[str, Any]], str]] = {
        "verdict": verdict,
        "why": why,
        "sentence": lambda row: row["sentence"] or "",
        "failure_prediction": predicted,
        "command": lambda row: without_seed(row, files, limits),
    }
    columns: dict[str, list[Any]] = {name: [] for name in ("seed", *words, *NUMBERS)}
    # texts repeat often, so each is kept once, and columns hold its number
    known: dict[str, dict[str, int]] = {name: {} for name in words}
    for own in cells:
        columns["seed"] += own.values("seed")
        for name in NUMBERS:
            columns[name] += [_rounded(x, _DECIMALS.get(name, 3)) for x in own.values(name)]
        for row in own.rows():
            for name, say in words.items():
                columns[name].append(known[name].setdefault(say(row), len(known[name])))
    values = {
        "ends": np.cumsum([len(own) for own in cells]).tolist(),  # the end of each cell's trials in the columns
        "words": {name: list(texts) for name, texts in known.items()},
        "numbers": [[name, label, _DECIMALS.get(name, 3)] for name, label in NUMBERS.items()],
        "columns": columns,
        "pictures": pictures,
    }
    text = json.dumps(values, separators=(",", ":"), allow_nan=False)
    return base64.b64encode(gzip.compress(text.encode(), compresslevel=6, mtime=0)).decode()


def _rounded(x: Any, decimals: int) -> float | int | None:
    """Round a number as it is shown; the script adds trailing zeros."""
    if x is None or isinstance(x, int):
        return x
    near = round(float(x), decimals)
    return int(near) if near == int(near) else near
