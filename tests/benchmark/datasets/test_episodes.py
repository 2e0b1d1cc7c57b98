"""Whole trials as tables: their numbers are those of the trials, and the card says what each column is."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyarrow import parquet

from apo_bench import InputError, TrialConfig, load_scenario, run_trial
from apo_bench.benchmark.datasets import making
from apo_bench.benchmark.datasets.episodes import EPISODES, FRAMES, replays
from apo_bench.benchmark.datasets.making import make_dataset
from apo_bench.cli.app import main
from apo_bench.geometry import pose


def read(path: Path) -> list[dict[str, Any]]:
    return parquet.read_table(path).to_pylist()


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("dataset") / "data"
    assert main(["dataset", "make", "block_on_block", "dovetail", "--episodes", "1", "--out", str(out)]) == 0
    return out


def test_an_episode_is_a_trial(made: Path) -> None:
    episodes = read(made / "episodes.parquet")
    assert [(each["scenario"], each["seed"]) for each in episodes] == [
        ("block_on_block", 1000000),
        ("dovetail", 1000000),
    ]
    clearance_mm = load_scenario("dovetail").clearance_mm
    row = run_trial(TrialConfig("dovetail", seed=1000000, noise_mm=1.0, noise_deg=1.0, clearance_mm=clearance_mm))
    one = episodes[1]
    assert {name: one[name] for name in ("config_hash", "success", "sentence", "method", "sim_time_s")} == {
        name: row[name] for name in ("config_hash", "success", "sentence", "method", "sim_time_s")
    }
    goals = [pose.unpack(np.reshape(one[f"{name}_goals"], (-1, 7))) for name in ("seen", "true", "planned")]
    errors = [np.linalg.norm((T - goals[1])[:, :3, 3]) for T in goals]
    assert errors[2] < errors[0]
    assert np.reshape(one["covariance"], (2, 6, 6)).shape[0] == len(one["seen"]) == len(one["main_parts"])
    assert one["schedule"] == [1, 2]


def test_frames_end_where_the_replay_did(made: Path) -> None:
    one = read(made / "episodes.parquet")[1]
    frames = read(made / "frames" / "000001.parquet")
    assert len(frames) == one["frames"] > 100
    assert {frame["episode"] for frame in frames} == {1}
    np.testing.assert_allclose(np.diff([frame["t_s"] for frame in frames]), 0.05, atol=1e-9)
    assert {frame["operation"] for frame in frames} - {None} == {1, 2}
    assert max(frame["force_n"] for frame in frames) > 0.1
    last = dict(zip(one["parts"], np.reshape(frames[-1]["part_poses"], (-1, 7)), strict=True))
    planned = dict(zip(one["main_parts"], np.reshape(one["planned_poses"], (-1, 7)), strict=True))
    for part, at in planned.items():
        np.testing.assert_allclose(last[part][:3], at[:3], atol=1e-3)
    assert len(frames[0]["joints"]) == 6
    asked = np.array([frame["commands"][:6] for frame in frames])
    np.testing.assert_allclose(asked, [frame["joints"] for frame in frames], atol=0.1)
    # At rest the arm carries its hand; with a part in it, more.
    pulls = np.linalg.norm([frame["wrench"][:3] for frame in frames], axis=1)
    assert 1.0 < np.median(pulls) < 30.0
    np.testing.assert_allclose(np.linalg.norm(np.reshape(frames[70]["part_poses"], (-1, 7))[:, 3:], axis=1), 1.0)


def test_the_card_says_what_every_column_is(made: Path) -> None:
    card = (made / "README.md").read_text(encoding="utf-8")
    assert set(parquet.read_schema(made / "episodes.parquet").names) == EPISODES.keys()
    assert set(parquet.read_schema(made / "frames" / "000000.parquet").names) == FRAMES.keys()
    for column, meaning in EPISODES.items():
        assert f"| `{column}` |  |  |  | {meaning} |" in card
    for column, field in FRAMES.items():
        assert f"| `{column}` | " in card
        assert f"| {field.unit} | {field.frame} | {field.meaning} |" in card
    assert "2 simulated trials, 2 of them right" in card
    assert "Licence: Apache-2.0" in card


def test_the_same_trials_give_the_same_tables_and_one_without_a_plan_has_no_frames(tmp_path: Path) -> None:
    trials = [
        TrialConfig("block_on_block", method=method, noise_mm=40, noise_deg=40) for method in ("uncorrected", "paper")
    ]
    said: list[str] = []
    for name in ("a", "b"):
        make_dataset(trials, tmp_path / name, "by hand", say=said.append)
    assert said == []
    files = [sorted(path.relative_to(tmp_path / name) for path in (tmp_path / name).rglob("*.*")) for name in "ab"]
    assert files[0] == files[1]
    for path in files[0]:
        assert (tmp_path / "a" / path).read_bytes() == (tmp_path / "b" / path).read_bytes()
    for each in read(tmp_path / "a" / "episodes.parquet"):
        frames = tmp_path / "a" / "frames" / f"{each['episode']:06}.parquet"
        assert frames.exists() == (each["frames"] > 0)
        assert (each["planned_poses"] is not None) or not each["frames"]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--out", "."], "is there already and not an empty folder"),
        (["--out", "new", "--record", "insertions"], "give the format lerobot, whose tables are Parquet"),
        (["--out", "new", "--seed", "999999"], "--seed must be at least 1000000"),
    ],
)
def test_what_is_wrong_is_said(
    words: list[str],
    complaint: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.txt").write_text("kept")
    assert main(["dataset", "make", "block_on_block", *words]) == 2
    assert complaint in capsys.readouterr().err
    assert [each.name for each in tmp_path.iterdir()] == ["mine.txt"]


def test_what_makes_no_episode_leaves_nothing_behind(tmp_path: Path) -> None:
    abstains = TrialConfig("block_on_block", method="uncorrected", min_predicted_success=1.0, seed=1)
    (tmp_path / "here").mkdir()
    for out in (tmp_path / "here", tmp_path / "new"):
        with pytest.raises(InputError, match="no trial made an episode, so nothing was written"):
            make_dataset([abstains], out, "by hand", "lerobot", say=lambda _: None)
    assert [each.name for each in tmp_path.iterdir()] == ["here"]
    assert not [*(tmp_path / "here").iterdir()]


def test_an_interrupt_keeps_the_episodes_that_had_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(trials: Any, scenes: Any) -> Any:
        yield from replays(trials[:1], scenes)
        raise KeyboardInterrupt

    monkeypatch.setattr(making, "replays", interrupted)
    trials = [TrialConfig("block_on_block", method="contact", seed=k) for k in range(3)]
    said: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        make_dataset(trials, tmp_path / "out", "by hand", "lerobot", say=said.append)
    assert said == ["1 episodes that had ended are kept."]
    assert "1 simulated trials" in (tmp_path / "out" / "README.md").read_text()


def test_a_policy_that_ends_the_program_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "leaving_policy.py").write_text(
        "import sys\ndef act(env, seen):\n    sys.exit(0)\nclass Made:\n    def __init__(self):\n        sys.exit(0)\n"
    )
    monkeypatch.chdir(tmp_path)
    words = ["dataset", "make", "block_on_block", "--episodes", "1", "--record", "insertions", "--format", "lerobot"]
    for name, line in (("act", 3), ("Made", 6)):
        assert main([*words, "--policy", f"leaving_policy:{name}", "--out", "out"]) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert f"the policy 'leaving_policy:{name}' raised SystemExit: 0 (" in said
        assert f"leaving_policy.py, line {line})." in said
        assert not (tmp_path / "out").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGTERM")
@pytest.mark.parametrize("form", ["parquet"])
def test_after_a_signal_the_data_set_is_finished(form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def signalled(trials: Any, scenes: Any) -> Any:
        assert [each.name for each in (tmp_path / "out").iterdir() if each.name == "UNFINISHED"]
        for each in replays(trials, scenes):
            os.kill(os.getpid(), signal.SIGTERM)
            yield each

    monkeypatch.setattr(making, "replays", signalled)
    words = ["dataset", "make", "block_on_block", "--episodes", "3", "--format", form, "--out", str(tmp_path / "out")]
    assert main(words) == 128 + signal.SIGTERM
    assert "1 simulated trials" in (tmp_path / "out" / "README.md").read_text()
    assert not (tmp_path / "out" / "UNFINISHED").exists()
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


@pytest.mark.skipif(sys.platform == "win32", reason="limits the size of files")
@pytest.mark.parametrize("form", ["lerobot", "minari"])
def test_a_full_disk_is_one_sentence_and_the_data_set_says_that_it_is_not_finished(form: str, tmp_path: Path) -> None:
    program = f"""
import resource
from apo_bench import TrialConfig
from apo_bench.benchmark.datasets import making
from apo_bench.benchmark.datasets.episodes import replays

def limited(trials, scenes):
    found = list(replays(trials, scenes))
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, resource.RLIM_INFINITY))
    return iter(found)

making.replays = limited
trials = [TrialConfig("block_on_block", method="uncorrected", noise_mm=0.0, noise_deg=0.0)]
try:
    making.make_dataset(trials, making.Path("out"), "by hand", {form!r})
except making.InputError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False)
    place = {"parquet": "frames/000000.parquet", "lerobot": "data/chunk-000/file-000.parquet"}
    path = place.get(form, "data/main_data.hdf5")
    assert done.stdout == f"out/{path} cannot be written (File too large); choose another place.\n", done.stderr
    assert done.stderr == ""
    assert [each.name for each in (tmp_path / "out").rglob("*") if each.is_file()] == ["UNFINISHED"]
