"""A score counts the rows of a sweep; programs and files of answers enter as correctors in Python do."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from apo_bench import InputError
from apo_bench.benchmark.scoring.entry import read_entry
from apo_bench.benchmark.scoring.track import read_track, read_tracks
from apo_bench.benchmark.sweeps.grid import check_grids, list_conditions
from apo_bench.cli.app import main
from apo_bench.records.run.run_folder import read_records

SMALL = """
scenario = ["block_on_block"]
noise_level = [1]
human_error_scale = [0]
trials = 2
grasp = ["weld"]

[track]
schema = "apo-bench/track/1"
title = "A small one"
"""
AS_OBSERVED = """
import json, sys
request = json.loads(sys.stdin.readline())
print(json.dumps({"poses": [{k: o[k] for k in ("position_mm", "quaternion_wxyz")} for o in request["operations"]]}))
"""


@pytest.fixture
def small(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(SMALL)
    (tmp_path / "seen.py").write_text(AS_OBSERVED)
    return tmp_path


def scored(small: Path, name: str, *entrant: str) -> dict[str, str]:
    command = ["score", *entrant, "--track", "small.toml", "--out", f"{name}.json", "--workers", "1"]
    assert main(command) == 0
    return dict(read_entry(small / f"{name}.json").tracks["small"].conditions)


def test_the_tracks_of_the_score_are_few_and_large_enough() -> None:
    tracks = read_tracks([])
    assert 0 < len(tracks) <= 8
    assert len({grid.seed for track in tracks for grid in track.grids}) == len(tracks)
    for track in tracks:
        (arm,) = track.arms
        grids = track.of("contact", arm)
        check_grids(grids)
        conditions = list_conditions(grids)
        assert len(conditions) * grids[0].trials >= (120 if track.name == "generated" else 470)
        assert grids[0].trials >= 10
        assert {grid.trials for grid in track.of("contact", arm, trials=1)} == {1}


def test_a_program_scores_as_the_same_corrector_in_python(small: Path) -> None:
    python = shutil.which("python3") or shutil.which("python")
    is_uncorrected = scored(small, "uncorrected", "uncorrected")
    assert scored(small, "program", "--command", f"{python} seen.py") == is_uncorrected


def test_an_entry_that_is_there_is_continued_and_made_the_same(small: Path) -> None:
    scored(small, "once", "contact")
    first = (small / "once.json").read_bytes()
    rows = (small / "once" / "small" / "six_axis" / "trials.jsonl").read_bytes()
    scored(small, "once", "contact")
    assert (small / "once" / "small" / "six_axis" / "trials.jsonl").read_bytes() == rows
    assert (small / "once.json").read_bytes() == first


def test_the_seeds_of_a_track_are_drawn_for_each_condition_and_are_those_of_the_records(small: Path) -> None:
    (small / "small.toml").write_text(SMALL.replace("[1]", "[1, 2]"))
    letters = scored(small, "once", "nominal")
    track = read_track("small.toml")
    trials = track.find_trials("six_axis")
    assert sorted(trials.values()) == [(f"block_on_block, noise_level {n}", k) for n in (1, 2) for k in (0, 1)]
    records = read_records(small / "once" / "small" / "six_axis")
    assert {record["seed"] for record in records} == set(trials)
    for record in records:
        condition, number = trials[record["seed"]]
        assert f"noise_level {record['noise_mm']:g}" in condition
        assert letters[condition][number] == str(int(bool(record["success"])))
    seed = next(iter(trials))
    expected = np.random.SeedSequence(0, spawn_key=(0, 0)).generate_state(1, np.uint64)[0] >> np.uint64(11)
    assert seed == expected
    again = ["run", "block_on_block", "--noise-level", "1", "--human-error-scale", "0", "--grasp", "weld"]
    assert main([*again, "--method", "nominal", "--seed", str(seed)]) in (0, 1)


def test_a_score_never_deletes_another_track(small: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scored(small, "one", "uncorrected")
    first = (small / "one.json").read_bytes()
    (small / "other.toml").write_text(SMALL)
    assert main(["score", "uncorrected", "--track", "other.toml", "--out", "one.json", "--workers", "1"]) == 2
    assert "would delete: small; add them with --track" in capsys.readouterr().err
    assert (small / "one.json").read_bytes() == first


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["score", "contact", "--track", "givn", "--out", "e.json"], "given"),
        (["score", "contact", "--track", "small.toml"], "--out"),
        (["score", "contact", "--track", "small.toml", "--name", "\x1b", "--out", "e.json"], "the name of the entry"),
        (["leaderboard", ".", "--out", "page.md"], "no entry"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(
    small: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert main(words) == 2
    message = capsys.readouterr().err
    assert said in message
    assert message.count("\n") == 1


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("trials = 2", "trials = 2\nmethod = 'contact'", "a track has no method"),
        ("track/1", "track/2", "schema"),
        ("[track]", "[[also]]\nseed = 5\n\n[track]", "have the same seed"),
        ("[track]", "[[also]]\ntrials = 5\n\n[track]", "have the same trials"),
    ],
)
def test_a_track_that_is_wrong_is_refused(small: Path, old: str, new: str, said: str) -> None:
    (small / "wrong.toml").write_text(SMALL.replace(old, new, 1))
    with pytest.raises(InputError, match=said):
        read_tracks(["wrong.toml"])
