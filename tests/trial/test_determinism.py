"""One integer is one trial: bit for bit, whoever runs it, in whatever order, in however many processes."""

from __future__ import annotations

from pathlib import Path

import pytest

from apo_bench import Scene, SweepConfig, TrialConfig, build_scene, load_scenario, run_sweep, run_trial
from apo_bench.records.run.run_folder import read_records
from apo_bench.trial.stages import simulate_demonstration

HOPELESS = 40.0
"""A level [mm, degrees] at which plans are refused before the arm moves, so that a trial costs little."""


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(load_scenario("stick_on_castles"), grasp="weld")


def test_a_trial_is_the_same_after_a_replay_and_in_a_new_scene(scene: Scene) -> None:
    spec = TrialConfig("stick_on_castles", grasp="weld", method="paper", seed=3)
    shown = simulate_demonstration(scene, 1.0, 3)
    first = run_trial(spec, scene, simulated=shown)
    assert first["sim_time_s"] > 1.0
    assert run_trial(spec, scene, simulated=shown) == first
    assert run_trial(spec, build_scene(load_scenario("stick_on_castles"), grasp="weld")) == first


@pytest.mark.slow
def test_rows_do_not_depend_on_workers_or_order(tmp_path: Path) -> None:
    """Here, one scenario after the other, and in 3 processes: the same lines, byte for byte, whole replays too.

    That 1 and 2 processes give the same, also where correctors misbehave, see `tests/benchmark/sweeps/test_local.py`.
    """
    methods = ("uncorrected", "paper")
    replayed = 0.5
    grids = (
        SweepConfig(("stick_on_castles",), (HOPELESS,), (1.0,), methods, trials=4),
        SweepConfig(("block_on_block", "stick_on_castles"), (replayed,), (1.0,), methods, trials=1, seed=21),
    )
    written = {}
    for workers in (None, 3):
        folder = tmp_path / str(workers)
        rows = run_sweep(grids, folder, workers=workers)
        assert rows == read_records(folder)
        written[workers] = sorted((folder / "trials.jsonl").read_bytes().splitlines())
    assert len(written[None]) == 8 + 4
    assert written[None] == written[3]
    assert sum(row["noise_mm"] == replayed and row["sim_time_s"] > 1.0 for row in rows) == 4
    alone = run_trial(
        TrialConfig("stick_on_castles", noise_mm=replayed, noise_deg=replayed, method="paper", seed=21),
        build_scene(load_scenario("stick_on_castles")),
    )
    assert alone in rows
