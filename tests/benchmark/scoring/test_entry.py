"""Entries: what is counted, what is refused, and how a table is made of them."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from apo_bench import InputError
from apo_bench.benchmark.scoring.entry import SCHEMA, Entry, TrackScore, read_entry, score_of, write_entry
from apo_bench.benchmark.scoring.leaderboard import ranked


def track(overall: bool = True, secret_seed: str | None = None, file: str = "f" * 16, **cells: str) -> TrackScore:
    counted = "".join(cells.values()).replace("x", "")
    value, low, high = score_of(cells)
    return TrackScore(
        track=file,
        overall=overall,
        score=value,
        low=low,
        high=high,
        trials=len(counted),
        executed=len(counted),
        predicted_success=None,
        brier=None,
        rows="0" * 16,
        code="1" * 16,
        secret_seed=secret_seed,
        cells=cells,
    )


def entry(name: str, **tracks: TrackScore) -> Entry:
    return Entry(SCHEMA, name, name, f"apo-bench score {name}", False, {"mujoco": "3"}, "machine", tracks)


def test_a_score_is_the_mean_over_cells_whatever_trials_count() -> None:
    assert score_of({"a": "1111", "b": "10xx"})[0] == pytest.approx(75.0)
    assert score_of({"a": "11", "b": "xx"})[0] == 100.0
    assert score_of({}) == (0.0, 0.0, 100.0)


def test_tracks_that_do_not_count_are_left_out_of_the_score_over_all() -> None:
    both = entry("m", given=track(a="10"), easy=track(overall=False, a="11"))
    overall = both.overall
    assert overall is not None
    assert overall == pytest.approx(score_of({"a": "10"}))
    assert entry("m", easy=track(overall=False, a="11")).overall is None


@settings(deadline=None)
@given(st.dictionaries(st.text("ab|", min_size=1), st.text("10x", min_size=1), min_size=1))
def test_what_is_written_is_read(cells: dict[str, str]) -> None:
    first = entry("m", given=replace(track(c="1"), **_of(cells)))
    with tempfile.TemporaryDirectory() as folder:
        write_entry(first, Path(folder) / "e.json")
        assert read_entry(Path(folder) / "e.json") == first


def _of(cells: dict[str, str]) -> dict[str, object]:
    made = track(**{f"c{i}": trials for i, trials in enumerate(cells.values())})
    names = ("score", "low", "high", "trials", "executed")
    return {**{name: getattr(made, name) for name in names}, "cells": cells}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"score": 99.0}, "the score 99 "),
        ({"executed": 0}, "0 of them executed, are stated, and its cells have 2 with 1 successes"),
        ({"cells": {"a": "1?"}}, "matching regex"),
        ({"low": -1.0}, ">= 0.0"),
        ({"rank": 1}, "unknown field"),
    ],
)
def test_a_score_by_hand_is_refused(tmp_path: Path, change: dict[str, object], said: str) -> None:
    write_entry(entry("m", given=track(a="10")), tmp_path / "e.json")
    form = json.loads((tmp_path / "e.json").read_text())
    form["tracks"]["given"] |= change
    (tmp_path / "e.json").write_text(json.dumps(form))
    with pytest.raises(InputError, match=said):
        read_entry(tmp_path / "e.json")


def test_the_best_stands_first() -> None:
    lines = ranked([entry("low", given=track(a="1000000000")), entry("high", given=track(a="1111111111", b="11"))])
    assert [line.entry.name for line in lines] == ["high", "low"]
    assert [line.place for line in lines] == [1, 2]


def test_verified_is_who_was_run_with_a_salt_of_the_organiser_in_every_track() -> None:
    secret_seed = "5" * 16
    salted = entry("salted", given=track(a="1", secret_seed=secret_seed), tight=track(a="1", secret_seed=secret_seed))
    half = entry("half", given=track(a="1", secret_seed=secret_seed), tight=track(a="1"))
    told = {line.entry.name: line.status for line in ranked([salted, half], frozenset({secret_seed}))}
    assert told == {"salted": "verified", "half": "self-reported"}
    assert {line.status for line in ranked([salted, half])} == {"self-reported"}
