"""A score counts the rows of a sweep; programs and files of answers enter as correctors in Python do."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import pytest

from apo_bench import InputError
from apo_bench.benchmark.scoring.entry import read_entry
from apo_bench.benchmark.scoring.track import read_track, read_tracks, track_names
from apo_bench.benchmark.sweeps.grid import AXES, check_grids
from apo_bench.cli.app import main

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
MOST = 240
FEWER = {"long": 80, "round": 80, "generated": 80}
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
    return dict(read_entry(small / f"{name}.json").tracks["small"].cells)


@pytest.mark.parametrize("name", track_names())
def test_every_track_is_no_larger_than_was_promised(name: str) -> None:
    track = read_track(name)
    for method in ("contact-robust", "contact+probe"):
        grids = [grid for arm in track.arms for grid in track.of(method, arm)]
        for grid in grids:
            check_grids([grid])
        sizes = [[max(1, len(getattr(grid, axis.name))) for axis in AXES] for grid in grids]
        trials = sum(grid.trials * math.prod(size) for grid, size in zip(grids, sizes, strict=True))
        assert 0 < trials <= FEWER.get(name, MOST)
        quick = [grid for arm in track.arms for grid in track.of(method, arm, quick=True)]
        assert all(grid.trials == track.quick_trials for grid in quick)


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
        ('title = "A small one"', 'title = "x"\nquick_trials = 0', "a whole number >= 1 is needed"),
        ("[track]", "[[also]]\nseed = 5\n\n[track]", "begin with the same seed"),
    ],
)
def test_a_track_that_is_wrong_is_refused(small: Path, old: str, new: str, said: str) -> None:
    (small / "wrong.toml").write_text(SMALL.replace(old, new, 1))
    with pytest.raises(InputError, match=said):
        read_tracks(["wrong.toml"])
