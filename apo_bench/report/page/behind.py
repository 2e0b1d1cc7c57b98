"""The rows behind the cells of a page: columns, packed, to be unpacked by the script when a cell is opened."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from apo_bench.records.limits import USUAL_LIMITS, Limits
from apo_bench.records.replay_command import Files, without_seed
from apo_bench.records.slim import NUMBERS
from apo_bench.report.page.markup import Html
from apo_bench.statistics.rates import Cell, by_place
from apo_bench.statistics.settings import at

FAILED, RIGHT, LOOSE, EXCLUDED = "failed", "right", "loosely right", "excluded"
OTHERWISE = "right, not as demonstrated"
DIGITS = 4
"""Significant digits of the numbers behind a cell."""


class Words:
    """Texts that are said often: kept once, and by number."""

    def __init__(self) -> None:
        self.numbers: dict[str, int] = {}

    def number(self, text: str) -> int:
        return self.numbers.setdefault(text, len(self.numbers))


def behind(
    rows: Iterable[Mapping[str, Any]],
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
    words = {name: Words() for name in ("verdict", "why", "sentence", "predicted", "command")}
    columns: dict[str, list[Any]] = {name: [] for name in ("seed", *words, *NUMBERS)}
    ends = []
    commands: dict[tuple[Any, ...], int] = {}
    for cell in cells:
        seeds = groups[at(cell)]
        for seed in sorted(seeds):
            row = seeds[seed]
            columns["seed"].append(seed)
            columns["verdict"].append(words["verdict"].number(verdict(row)))
            columns["why"].append(words["why"].number(why(row)))
            columns["sentence"].append(words["sentence"].number(row.get("sentence") or ""))
            columns["predicted"].append(words["predicted"].number(foretold(row.get("predicted"))))
            asked = _asked(row)
            if asked not in commands:
                commands[asked] = words["command"].number(without_seed(row, files, limits))
            columns["command"].append(commands[asked])
            for name in NUMBERS:
                columns[name].append(rounded(row.get(name)))
        ends.append(len(columns["seed"]))
    return {
        "ends": ends,
        "words": {name: list(kept.numbers) for name, kept in words.items()},
        "numbers": [[name, label] for name, label in NUMBERS.items()],
        "columns": columns,
        "pictures": {f"{cell}:{seed}": k for (cell, seed), k in (pictured or {}).items()},
    }


def packed(values: Mapping[str, Any]) -> Html:
    """As base64 of gzip of JSON: letters that mean nothing in HTML; the same bytes for the same values."""
    text = json.dumps(values, separators=(",", ":"), allow_nan=False).encode()
    return Html(base64.b64encode(gzip.compress(text, compresslevel=6, mtime=0)).decode())


def verdict(row: Mapping[str, Any]) -> str:
    """How a trial ended, in a word or two."""
    if row["success"] is None:
        return EXCLUDED
    if row["success"]:
        return RIGHT if row["as_demonstrated"] else OTHERWISE
    return LOOSE if row["loose_success"] else FAILED


def why(row: Mapping[str, Any]) -> str:
    """`attach: force_stop, operation 3`; nothing where nothing failed."""
    if row["failure_stage"] is None:
        return ""
    where = "" if row.get("failure_operation") is None else f", operation {row['failure_operation']}"
    return f"{row['failure_stage']}: {row['failure_code']}{where}"


def foretold(said: Mapping[str, Any] | None) -> str:
    """What the plan said beforehand."""
    if said is None:
        return ""
    return f"operation {said['operation']} fails: {said['code']}" if said["fails"] else "fits"


def rounded(x: Any) -> float | int | None:
    """To so many digits as are shown."""
    if x is None or isinstance(x, int):
        return x
    near = float(f"{x:.{DIGITS}g}")
    return int(near) if near == int(near) else near


def _asked(row: Mapping[str, Any]) -> tuple[Any, ...]:
    names = ("scenario", "level", "level_deg", "careless", "clearance_mm", "eye", "noise", "grasp", "arm", "relations")
    lost = row.get("failure_stage") == "worker"
    return (*(row.get(name) for name in names), row["method"], row.get("timestep_s"), row.get("fidelity"), lost)
