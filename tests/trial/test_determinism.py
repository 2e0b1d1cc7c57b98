"""One integer is one trial: bit for bit, whoever runs it, in whatever order, in however many processes."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from apo_bench.cli.app import main
from apo_bench.records.run.run_folder import read_rows
from apo_bench.records.settings import TrialSettings
from apo_bench.scenario.file import load_scenario
from apo_bench.simulation.scene.scene import Scene, build_scene
from apo_bench.sweeps.grid import SweepSettings
from apo_bench.sweeps.sweep import run_sweep
from apo_bench.trial.stages import record_demonstration
from apo_bench.trial.trial import run_trial

HOPELESS = 40.0
"""A level [mm, degrees] at which plans are refused before the arm moves, so that a trial costs little."""


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(load_scenario("stick_on_castles"), grasp="weld")


def by_seed_and_method(rows: list[dict[str, Any]]) -> list[str]:
    return sorted(json.dumps(row) for row in rows)


def test_a_demonstration_is_the_same_after_others(scene: Scene) -> None:
    first = record_demonstration(scene, 1.0, 4)
    other = record_demonstration(scene, 1.0, 5)
    again = record_demonstration(scene, 1.0, 4)
    assert not np.array_equal(first.demonstration.goals, other.demonstration.goals)
    np.testing.assert_array_equal(first.layout.goals, again.layout.goals)
    np.testing.assert_array_equal(first.demonstration.goals, again.demonstration.goals)
    for part, T in first.demonstration.final.items():
        np.testing.assert_array_equal(T, again.demonstration.final[part])


def test_layout_and_hand_do_not_depend_on_carelessness(scene: Scene) -> None:
    careful, careless = record_demonstration(scene, 0.0, 4), record_demonstration(scene, 1.0, 4)
    np.testing.assert_array_equal(careful.layout.goals, careless.layout.goals)
    np.testing.assert_array_equal(careful.demonstration.goals[0], careless.demonstration.goals[0])


def test_a_trial_is_the_same_after_a_replay_and_in_a_new_scene(scene: Scene) -> None:
    spec = TrialSettings("stick_on_castles", grasp="weld", method="paper", seed=3)
    shown = record_demonstration(scene, 1.0, 3)
    first = run_trial(spec, scene, recording=shown)
    assert first["sim_seconds"] > 1.0
    assert run_trial(spec, scene, recording=shown) == first
    assert run_trial(spec, build_scene(load_scenario("stick_on_castles"), grasp="weld")) == first


def test_rows_do_not_depend_on_the_number_of_workers(tmp_path: Path) -> None:
    """Here, and in 1 and 4 processes: the same lines, byte for byte."""
    spec = SweepSettings(("stick_on_castles",), (HOPELESS,), (1.0,), ("none", "paper"), trials=4, grasps=("weld",))
    written = {}
    for workers in (None, 1, 4):
        folder = tmp_path / str(workers)
        rows = run_sweep(spec, folder, workers=workers)
        assert rows == read_rows(folder)
        written[workers] = sorted((folder / "trials.jsonl").read_bytes().splitlines())
    assert len(written[None]) == 8
    assert written[None] == written[1] == written[4]


@pytest.mark.slow
def test_whole_replays_do_not_depend_on_workers_or_order(tmp_path: Path) -> None:
    """Here, one scenario after the other, and in a process for each."""
    scenarios, methods = ("stick_in_tower", "stick_on_castles"), ("none", "paper")
    spec = SweepSettings(scenarios, levels=(0.5,), careless=(1.0,), methods=methods, trials=1, seed=21)
    here = run_sweep(spec, tmp_path / "here")
    two = run_sweep(spec, tmp_path / "two", workers=2)
    assert len(here) == 4
    assert by_seed_and_method(here) == by_seed_and_method(two)
    alone = run_trial(
        TrialSettings("stick_in_tower", level_mm=0.5, level_deg=0.5, method="paper", seed=21),
        build_scene(load_scenario("stick_in_tower")),
    )
    assert alone in two


@pytest.mark.slow
def test_an_interrupt_keeps_whole_rows_and_the_same_command_goes_on(tmp_path: Path) -> None:
    out = tmp_path / "run"
    command = [
        *("sweep", "stick_on_castles", "--levels", "0,1", "--careless", "1", "--methods", "none,paper"),
        *("--trials", "3", "--grasp", "weld", "--workers", "2", "--out", str(out)),
    ]
    process = subprocess.Popen(
        [sys.executable, "-m", "apo_bench.cli.app", *command],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell may have it ignored
    )
    deadline = time.monotonic() + 120
    while not (out / "trials.jsonl").exists() or not (out / "trials.jsonl").read_bytes():
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.1)
    process.send_signal(signal.SIGINT)
    _, complaint = process.communicate(timeout=60)
    assert process.returncode == 130
    assert complaint.startswith("apo-bench: interrupted")
    assert "Traceback" not in complaint
    left = read_rows(out)
    assert 0 < len(left) < 12
    assert (out / "trials.jsonl").read_bytes().endswith(b"\n")
    assert main(command) == 0
    rows = read_rows(out)
    assert rows[: len(left)] == left
    assert len({json.dumps(row) for row in rows}) == 12
