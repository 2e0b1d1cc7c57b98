"""Score a method over the trials of tracks, and return an entry."""

import hashlib
import json
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.benchmark.analysis.rates import compute_brier_score, compute_mean, measure_reliability, was_executed
from apo_bench.benchmark.scoring.entry import EXCLUDED, RIGHT, SCHEMA, WRONG, Entry, TrackScore, check_name, score_of
from apo_bench.benchmark.scoring.track import Track
from apo_bench.benchmark.sweeps.sweep import run_sweep
from apo_bench.io import clean, group_by, shorten_text
from apo_bench.records import SETTINGS, TrialRecord
from apo_bench.records.run.run_file import read_run
from apo_bench.records.run.trials import make_trials
from apo_bench.trial.fingerprint import find_git_revision

_HEX = 16  # digits of a hash


@check_arguments
def score(
    method: str,
    tracks: Sequence[Track],
    rows: str | Path,
    *,
    name: str | None = None,
    trials: int | None = None,
    command: str = "",
    said: Callable[[Track], None] = lambda _: None,
    **how: Any,
) -> Entry:
    """Score a method in tracks.

    Args:
        method: As for `run_sweep`.
        rows: The folder of the records, with a folder for each track and arm; a folder with records of the same trials
        is
            continued.
        name: The name in tables; default: the method.
        trials: The first so many trials of each condition; default: all.
        command: The command line, for the entry.
        said: Called with each track before it runs.
        how: As for `run_sweep`: `workers`, `backend`, `secret_seed_file`.

    Raises:
        InputError, RuntimeError, KeyboardInterrupt: As `run_sweep`; records of finished trials are kept.
    """
    name = name or method
    check_name("entry", name)
    for track in tracks:
        check_name("track", track.name)
    scores = {}
    versions: Mapping[str, str] = {}
    for track in tracks:
        said(track)
        records: list[TrialRecord] = []
        conditions: dict[str, str] = {}
        for arm in track.arms:
            folder = Path(rows) / track.name / Path(arm).stem.replace(":", "_")
            folder.parent.mkdir(parents=True, exist_ok=True)
            made = run_sweep(track.of(method, arm, trials), folder, command=command, **how)
            conditions |= _spell_conditions(made, track.find_trials(arm, trials))
            records += made
            run = read_run(folder)
            versions = {"python": run["python"], **run["versions"]}
        scores[track.name] = _score_track(track, conditions, records, run)
    return Entry(
        schema=SCHEMA,
        name=name,
        method=(SETTINGS["method"].spelled or str)(method),
        command=shorten_text(clean(command)),
        versions=dict(sorted(versions.items())),
        revision=find_git_revision(),
        machine=platform.platform(),
        tracks=scores,
    )


def _score_track(
    track: Track, conditions: Mapping[str, str], records: Sequence[TrialRecord], run: Mapping[str, Any]
) -> TrackScore:
    """Score a track from the records with all of its arms."""
    trials = make_trials(records)
    counted = trials.where(~np.isnan(trials.number("success")))
    value, low, high = score_of(conditions)
    return TrackScore(
        track=track.hash,
        overall=track.overall,
        score=value,
        low=low,
        high=high,
        trials=len(counted),
        executed=int(was_executed(counted).sum()),
        predicted_success=compute_mean(counted.number("predicted_success")),
        brier=compute_brier_score(counted),
        reliability=measure_reliability(counted),
        records=_digest(sorted(json.dumps(record, sort_keys=True) for record in records)),
        code=_digest([json.dumps({key: run[key] for key in ("versions", "content")}, sort_keys=True)]),
        secret_seed=run.get("secret_seed"),
        conditions=conditions,
    )


def _spell_conditions(records: Iterable[TrialRecord], trials: Mapping[int, tuple[str, int]]) -> dict[str, str]:
    """Return settings of a condition -> its trials, one letter each, by their number.

    Args:
        trials: Seed -> condition of a trial, and its number.
    """
    spelled = {True: RIGHT, False: WRONG, None: EXCLUDED}
    letters = group_by((trials[record["seed"]], spelled[record["success"]]) for record in records)
    return {
        condition: "".join(letters[key][0] for key in sorted(own))
        for condition, own in group_by((key[0], key) for key in letters).items()
    }


def _digest(lines: Iterable[str]) -> str:
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()[:_HEX]
