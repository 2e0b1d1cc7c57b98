"""The trials of every cell of a page: columns, packed, to be unpacked by the script when a cell is opened."""

import base64
import gzip
import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from markupsafe import Markup

from apo_bench.records.limits import USUAL_LIMITS, Limits
from apo_bench.records.row import Row, look_up
from apo_bench.records.run.replay_command import Files, without_seed
from apo_bench.records.run.report_rows import NUMBERS
from apo_bench.records.settings import SETTINGS
from apo_bench.report.trial_words import verdict, why
from apo_bench.statistics.rates import Cell, by_place
from apo_bench.statistics.settings import cell_place

DECIMALS = {"extra_operations": 0, "least_overlap": 2, "peak_force_n": 1, "sim_seconds": 1}
"""Of numbers; of those in mm and degrees, and of others, three."""
ASKED = tuple(info.column for name, info in SETTINGS.items() if name not in ("seed", "salt"))
"""What commands of trials differ in, but for seeds and for what was lost."""


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
        seeds = groups[cell_place(cell)]
        for seed in sorted(seeds):
            row = seeds[seed]
            asked = (*(look_up(row, name) for name in ASKED), row.get("failure_stage") == "worker")
            if asked not in commands:
                commands[asked] = without_seed(row, files, limits)
            said = {
                "verdict": verdict(row),
                "why": why(row),
                "sentence": row.get("sentence") or "",
                "predicted": predicted(row.get("predicted")),
                "command": commands[asked],
            }
            columns["seed"].append(seed)
            for name, text in said.items():
                columns[name].append(words[name].setdefault(text, len(words[name])))
            for name in NUMBERS:
                columns[name].append(rounded(row.get(name), DECIMALS.get(name, 3)))
        ends.append(len(columns["seed"]))
    return {
        "ends": ends,
        "words": {name: list(kept) for name, kept in words.items()},
        "numbers": [[name, label, DECIMALS.get(name, 3)] for name, label in NUMBERS.items()],
        "columns": columns,
        "pictures": {f"{cell}:{seed}": k for (cell, seed), k in (pictured or {}).items()},
    }


def packed_json(values: Mapping[str, Any]) -> Markup:
    """Values as base64 of gzip of JSON: letters that mean nothing in HTML; equal bytes for equal values."""
    text = json.dumps(values, separators=(",", ":"), allow_nan=False).encode()
    return Markup(base64.b64encode(gzip.compress(text, compresslevel=6, mtime=0)).decode())


def predicted(said: Mapping[str, Any] | None) -> str:
    """What the plan said beforehand."""
    if said is None:
        return ""
    return f"operation {said['operation']} fails: {said['code']}" if said["fails"] else "fits"


def rounded(x: Any, decimals: int) -> float | int | None:
    """A number as it is shown; the script writes the zeros at the end."""
    if x is None or isinstance(x, int):
        return x
    near = round(float(x), decimals)
    return int(near) if near == int(near) else near
