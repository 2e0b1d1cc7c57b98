"""Score a method: run the trials of tracks, resumed where they were left, and count."""

import hashlib
import json
import math
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from apo_bench.arguments import check_arguments
from apo_bench.benchmark.analysis import NOT_EXECUTED, PLACE_FIELDS, place_of
from apo_bench.benchmark.scoring.entry import EXCLUDED, RIGHT, SCHEMA, WRONG, Entry, TrackScore, check_name, score_of
from apo_bench.benchmark.scoring.track import Track
from apo_bench.benchmark.sweeps.sweep import run_sweep
from apo_bench.io import brief, clean, grouped
from apo_bench.records import SETTINGS, TrialRecord
from apo_bench.records.run.run_file import read_run

_HEX = 16
_CELL = tuple(name for name in PLACE_FIELDS if name != "method")


@check_arguments
def score(
    method: str,
    tracks: Sequence[Track],
    rows: str | Path,
    *,
    name: str | None = None,
    quick: bool = False,
    command: str = "",
    said: Callable[[Track], None] = lambda _: None,
    **how: Any,
) -> Entry:
    """What a method scores in tracks.

    Args:
        method: As for `run_sweep`.
        rows: The folder of the rows, one folder below it for each track and arm; continued if it holds rows of the
            same trials.
        name: What tables call it; None for the method's.
        quick: A few seeds of each cell, to see whether it works.
        command: What to note as the command line.
        said: Called with each track before it runs.
        how: As for `run_sweep`: `workers`, `backend`, `salt_file`.

    Raises:
        InputError, RuntimeError, KeyboardInterrupt: As `run_sweep`; what had ended is kept.
    """
    name = name or method
    check_name("entry", name)
    for track in tracks:
        check_name("track", track.name)
    scores = {}
    versions: Mapping[str, str] = {}
    for track in tracks:
        said(track)
        runs = {}
        for arm in track.arms:
            folder = Path(rows) / track.name / Path(arm).stem.replace(":", "_")
            folder.parent.mkdir(parents=True, exist_ok=True)
            runs[arm] = run_sweep(track.of(method, arm, quick), folder, command=command, **how)
            run = read_run(folder)
            versions = {"python": run["python"], **run["versions"]}
        scores[track.name] = _scored(track, runs, run)
    return Entry(
        schema=SCHEMA,
        name=name,
        method=(SETTINGS["method"].spelled or str)(method),
        command=brief(clean(command)),
        quick=quick,
        versions=dict(sorted(versions.items())),
        machine=platform.platform(),
        tracks=scores,
    )


def _scored(track: Track, runs: Mapping[str, Sequence[TrialRecord]], run: Mapping[str, Any]) -> TrackScore:
    """What the rows of a track say, of all of its arms."""
    rows = [row for own in runs.values() for row in own]
    counted = [row for row in rows if row["success"] is not None]
    promises = [(p, row) for row in counted if (p := row.get("predicted_success")) is not None]
    carried = [row for row in counted if row["failure_stage"] not in NOT_EXECUTED]
    errors = [(p - bool(row["success"])) ** 2 for p, row in promises if row["failure_stage"] not in NOT_EXECUTED]
    cells = _cells(rows)
    value, low, high = score_of(cells)
    return TrackScore(
        track=track.hash,
        overall=track.overall,
        score=value,
        low=low,
        high=high,
        trials=len(counted),
        executed=len(carried),
        predicted_success=_mean([p for p, _ in promises]),
        brier=_mean(errors),
        rows=_digest(sorted(json.dumps(row, sort_keys=True) for row in rows)),
        code=_digest([json.dumps({key: run[key] for key in ("versions", "content")}, sort_keys=True)]),
        secret_seed=run.get("secret_seed"),
        cells=cells,
    )


def _cells(rows: Iterable[TrialRecord]) -> dict[str, str]:
    """Settings of a cell -> how its trials ended, the first seed first."""
    cells = grouped((_cell(row), row) for row in rows)
    spell = partial(map, lambda row: EXCLUDED if row["success"] is None else (WRONG, RIGHT)[row["success"]])
    return {key: "".join(spell(sorted(cells[key], key=lambda row: row["seed"]))) for key in sorted(cells)}


def _cell(row: TrialRecord) -> str:
    """What the trials of a cell have in common, but for the method."""
    place = place_of(row)
    assert place is not None  # trials of a sweep have a level
    return "|".join([row["arm"], *(f"{asdict(place)[name]}" for name in _CELL)])


def _digest(lines: Iterable[str]) -> str:
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:_HEX]


def _mean(numbers: Sequence[float]) -> float | None:
    return math.fsum(numbers) / len(numbers) if numbers else None  # in whatever order trials ended
