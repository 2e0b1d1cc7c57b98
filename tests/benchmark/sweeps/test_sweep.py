"""A sweep: which trials, resumed where it was left, the same rows however it is spread.

Bookkeeping is tested with trials that cost nothing; `test_determinism.py` runs real ones.
"""

from __future__ import annotations

import functools
import json
from collections import Counter
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from apo_bench import InputError, SweepConfig, load_scenario
from apo_bench.assembly import Outcome
from apo_bench.benchmark.sweeps import sweep as runner
from apo_bench.benchmark.sweeps import worker
from apo_bench.benchmark.sweeps.grid import list_work_units, load_all
from apo_bench.records import ENV_ID, RECORD_SCHEMA, get_record_key, list_setting_columns, make_trial_key
from apo_bench.records.run.run_folder import read_records
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.trial import record_start_and_end, run
from apo_bench.trial.fingerprint import compute_config_hash
from apo_bench.trial.record_start_and_end import end_record

METHODS = ("oracle", "uncorrected", "paper")
SPEC = SweepConfig(
    ("stick_in_tower",), noise_level=(0.0, 1.0), human_error_scale=(1.0,), method=METHODS, trials=3, seed=10
)
ROWS = 3 * (1 + 2 * 2)
LOAD = functools.cache(load_scenario)


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Trials without physics; counts what a worker did."""
    did: Counter[str] = Counter()

    def compiled(spec: Any) -> Any:
        did["scene"] += 1
        return SimpleNamespace(scenario=LOAD(spec.scenario), arm=find_arm("six_axis"))

    def record(spec: Any, scene: Any) -> str:
        did["demonstration"] += 1
        return f"{scene.scenario.name} {spec.human_error_scale} {spec.seed} {spec.pose_source}"

    def run_trial(spec: Any, scene: Any, *, simulated: str, content: str, cache: Any) -> dict[str, Any]:
        did["trial"] += 1
        assert simulated == f"{scene.scenario.name} {spec.human_error_scale} {spec.seed} {spec.pose_source}"
        hashed = compute_config_hash(spec, content)
        success = spec.seed % 2 == 0
        ended = end_record(
            Outcome("done", "ok", None, "") if success else Outcome("judge", "gap", None, ""), success=success
        )
        ended |= {"demonstration": "ok", "sim_time_s": 1.0, "extra_steps": 0}
        return {
            "schema": RECORD_SCHEMA,
            "env_id": ENV_ID,
            "config_hash": hashed,
            **list_setting_columns(spec, scene.scenario.name),
            **ended,
        }

    monkeypatch.setattr("apo_bench.benchmark.sweeps.grid.load_scenario", LOAD)
    monkeypatch.setattr(record_start_and_end, "load_scenario", LOAD)
    monkeypatch.setattr(worker, "scene_of", compiled)
    monkeypatch.setattr(worker, "demonstration_of", record)
    monkeypatch.setattr(run, "run_trial", run_trial)
    return did


def test_the_grid_is_every_combination_once() -> None:
    two = ("stick_in_tower", "stick_on_castles")
    spec = SweepConfig(two, (0, 1, 1), (0, 1), METHODS, clearance_mm=(0.25, 0.5), trials=2)
    loaded = load_all([spec])
    keys = [make_trial_key(t, loaded[t.scenario].name) for unit in list_work_units([spec], loaded) for t in unit]
    assert len(set(keys)) == len(keys) == 2 * 2 * 2 * (1 + 2 * 2 * 2)
    assert {key[2] for key in keys} == {0, 1}


def test_noises_and_relations_are_axes_but_only_of_those_who_meet_them() -> None:
    spec = replace(
        SPEC,
        noise=("isotropic", "per-part"),
        contact_source=("given", "false-negative", "face-offset:3.0mm", "face-offset:3mm"),
    )
    assert spec.contact_source == ("given", "false-negative", "face-offset:3mm")
    loaded = load_all([spec])
    trials = [t for unit in list_work_units([spec], loaded) for t in unit]
    keys = {make_trial_key(t, "stick_in_tower") for t in trials}
    assert len(keys) == len(trials) == 3 * (1 + 2 * 2 * (1 + 3))
    met = {m: {(t.noise, t.contact_source) for t in trials if t.method == m} for m in spec.method}
    assert met["oracle"] == {("isotropic", "given")}
    assert met["uncorrected"] == {("isotropic", "given"), ("per-part", "given")}
    assert len(met["paper"]) == 6


def test_a_sweep_that_no_memory_holds_is_refused(tmp_path: Path) -> None:
    huge = replace(SPEC, trials=1_000_000)
    with pytest.raises(InputError, match=r"up to [0-9,]+ trials, and at most 1,000,000 are allowed in one folder"):
        runner.run_sweep(huge, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_sweep_writes_every_row_and_its_timing(counted: Counter[str], tmp_path: Path) -> None:
    rows = runner.run_sweep(SPEC, tmp_path / "new" / "run", command="apo-bench sweep ...")
    assert len(rows) == ROWS
    assert read_records(tmp_path / "new" / "run") == rows
    timing = [json.loads(line) for line in (tmp_path / "new" / "run" / "timing.jsonl").open()]
    assert [get_record_key(t) for t in timing] == [get_record_key(r) for r in rows]
    assert {"trial_s", "demonstrate_s", "host", "worker"} <= set(timing[0])
    run = json.loads((tmp_path / "new" / "run" / "run.json").read_text())
    assert run["command"] == "apo-bench sweep ..."
    assert run["grids"][0]["clearance_mm"] == {"stick_in_tower": [0.25]}
    assert run["versions"]["mujoco"]


def test_scenes_and_demonstrations_are_shared(counted: Counter[str], tmp_path: Path) -> None:
    runner.run_sweep(SPEC, tmp_path)
    assert counted == {"scene": 1, "demonstration": 3 * 2, "trial": ROWS}


def test_an_interrupted_sweep_goes_on_where_it_was_left(
    counted: Counter[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = runner.run_sweep(SPEC, tmp_path / "whole")
    quick = run.run_trial

    def interrupted(spec: Any, scene: Any, **more: Any) -> Any:
        if (spec.seed, spec.method, spec.noise_mm) == (11, "paper", 0.0):
            raise KeyboardInterrupt
        return quick(spec, scene, **more)

    monkeypatch.setattr(run, "run_trial", interrupted)
    with pytest.raises(KeyboardInterrupt):
        runner.run_sweep(SPEC, tmp_path / "part")
    left = read_records(tmp_path / "part")
    assert 0 < len(left) < ROWS
    monkeypatch.setattr(run, "run_trial", quick)
    counted.clear()
    assert runner.run_sweep(SPEC, tmp_path / "part") == whole
    assert counted["trial"] == ROWS - len(left)


def test_more_trials_of_the_same_sweep_are_welcome(counted: Counter[str], tmp_path: Path) -> None:
    first = runner.run_sweep(SPEC, tmp_path)
    rows = runner.run_sweep(replace(SPEC, trials=5), tmp_path)
    assert rows[: len(first)] == first
    assert {row["seed"] for row in rows} == {10, 11, 12, 13, 14}
    with pytest.raises(InputError, match="trials was 5, now 3"):
        runner.run_sweep(SPEC, tmp_path)


@pytest.mark.parametrize(("change", "words"), [({"seed": 11}, "grid: seed was 10, now 11")])
def test_a_folder_of_another_sweep_is_refused(
    change: dict[str, Any], words: str, counted: Counter[str], tmp_path: Path
) -> None:
    runner.run_sweep(SPEC, tmp_path)
    before = (tmp_path / "run.json").read_bytes()
    with pytest.raises(InputError, match=words):
        runner.run_sweep(replace(SPEC, **change), tmp_path)
    assert (tmp_path / "run.json").read_bytes() == before


def test_rows_made_by_other_versions_are_refused(counted: Counter[str], tmp_path: Path) -> None:
    runner.run_sweep(SPEC, tmp_path)
    run = json.loads((tmp_path / "run.json").read_text())
    run["versions"]["mujoco"] = "3.16.0"
    (tmp_path / "run.json").write_text(json.dumps(run))
    with pytest.raises(InputError, match=r'versions: mujoco was "3.16.0"'):
        runner.run_sweep(SPEC, tmp_path)
    (tmp_path / "run.json").unlink()
    with pytest.raises(InputError, match=r"no readable run\.json"):
        runner.run_sweep(SPEC, tmp_path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"scenario": ("stick_in_towr",)}, "did you mean 'stick_in_tower'"),
        ({"arm": "seven_axis"}, "did you mean 'six_axis'"),
        ({"method": ("json:nothing",)}, "unknown corrector in module json 'nothing'"),
    ],
)
def test_names_are_checked_before_a_folder_is_made(change: dict[str, Any], words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words):
        runner.run_sweep(replace(SPEC, **change), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_row_that_was_made_with_something_else_is_refused(counted: Counter[str], tmp_path: Path) -> None:
    rows = runner.run_sweep(SPEC, tmp_path)
    rows[4]["config_hash"] = "0" * 16
    (tmp_path / "trials.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    with pytest.raises(
        InputError, match=r"holds a record of stick_in_tower, method \w+, seed 1\d, that was made with other"
    ):
        runner.run_sweep(SPEC, tmp_path)


def test_several_grids_make_one_folder(counted: Counter[str], tmp_path: Path) -> None:
    further = replace(SPEC, noise_level=(1.0, 2.0), method=("paper",), trials=1)
    rows = runner.run_sweep([SPEC, further], tmp_path)
    assert len({get_record_key(row) for row in rows}) == len(rows) == ROWS + 1
    assert len(json.loads((tmp_path / "run.json").read_text())["grids"]) == 2
    with pytest.raises(InputError, match="it had 2 grids, now 1"):
        runner.run_sweep(SPEC, tmp_path)
    assert runner.run_sweep([replace(SPEC, trials=4), further], tmp_path)[: len(rows)] == rows
