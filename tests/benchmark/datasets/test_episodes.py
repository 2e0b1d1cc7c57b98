"""Whole trials as tables: their numbers are those of the trials, and the card says what each column is."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyarrow import parquet

from apo_bench import TrialConfig, load_scenario, run_trial
from apo_bench.benchmark.datasets import trial_dataset
from apo_bench.benchmark.datasets.card import count_outcomes
from apo_bench.benchmark.datasets.episodes import EPISODES, FRAMES, record_replays
from apo_bench.benchmark.datasets.trial_dataset import make_dataset
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
    goals = [pose.unpack(np.reshape(one[f"{name}_poses"], (-1, 7))) for name in ("observed", "true", "planned")]
    errors = [np.linalg.norm((T - goals[1])[:, :3, 3]) for T in goals]
    assert errors[2] < errors[0]
    assert np.reshape(one["covariance"], (2, 6, 6)).shape[0] == len(one["observed"]) == len(one["main_parts"])
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


def test_outcomes_are_counted_by_code_and_no_failure_is_a_success() -> None:
    replays = [{"failure_code": None}, {"failure_code": "gap"}, {"failure_code": "gap"}]
    assert count_outcomes(replays) == {"ok": 1, "gap": 2}
    assert count_outcomes([{"code": "ok"}, {"code": "force_stop"}]) == {"ok": 1, "force_stop": 1}


def test_the_card_says_what_every_column_is(made: Path) -> None:
    card = (made / "README.md").read_text(encoding="utf-8")
    assert set(parquet.read_schema(made / "episodes.parquet").names) == EPISODES.keys()
    assert set(parquet.read_schema(made / "frames" / "000000.parquet").names) == FRAMES.keys()
    for column, meaning in EPISODES.items():
        assert f"| `{column}` |  |  |  | {meaning} |" in card
    for column, field in FRAMES.items():
        assert f"| `{column}` | " in card
        assert f"| {field.unit} | {field.frame} | {field.meaning} |" in card
    assert "2 simulated trials, 2 right" in card
    assert "| `ok` | 2 | 100% |" in card
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
        (["--out", "new", "--episode-type", "insertions"], "give the format lerobot, whose tables are Parquet"),
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


@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGTERM")
@pytest.mark.parametrize("form", ["parquet"])
def test_after_a_signal_the_data_set_is_finished(form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def signalled(trials: Any, scenes: Any) -> Any:
        assert [each.name for each in (tmp_path / "out").iterdir() if each.name == "UNFINISHED"]
        for each in record_replays(trials, scenes):
            os.kill(os.getpid(), signal.SIGTERM)
            yield each

    monkeypatch.setattr(trial_dataset, "record_replays", signalled)
    words = ["dataset", "make", "block_on_block", "--episodes", "3", "--format", form, "--out", str(tmp_path / "out")]
    assert main(words) == 128 + signal.SIGTERM
    assert "1 simulated trial," in (tmp_path / "out" / "README.md").read_text()
    assert not (tmp_path / "out" / "UNFINISHED").exists()
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
