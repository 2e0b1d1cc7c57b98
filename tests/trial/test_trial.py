"""One trial: its stages, its row, its hash. Physics runs once per method; the rest looks at what came out."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from apo_bench import (
    Correction,
    InputError,
    Observation,
    Scene,
    TrialConfig,
    build_scene,
    correct,
    load_scenario,
    run_trial,
)
from apo_bench.assembly import Consistency, FreeingTrial, Suspect, build_relation_graph
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.records import ENV_ID, RECORD_FIELDS, RECORD_SCHEMA, outcomes
from apo_bench.records.settings import LARGEST_SEED
from apo_bench.resources import folder
from apo_bench.trial.fingerprint import compute_config_hash, compute_content_hash
from apo_bench.trial.run import run_measured
from apo_bench.trial.trial_stages import SimulatedDemonstration, observe_demonstration, simulate_demonstration

SPEC = TrialConfig("stick_in_tower", grasp="weld", method="uncorrected", seed=5)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(load_scenario("stick_in_tower"), grasp="weld")


@pytest.fixture(scope="module")
def shown(scene: Scene) -> SimulatedDemonstration:
    return simulate_demonstration(scene, 1.0, SPEC.seed)


@pytest.fixture(scope="module")
def rows(scene: Scene, shown: SimulatedDemonstration) -> dict[str, dict[str, Any]]:
    return {m: run_trial(replace(SPEC, method=m), scene, simulated=shown) for m in ("oracle", "uncorrected", "paper")}


def refuses(seen: Observation) -> Correction:
    """A corrector that never converges."""
    tried = (FreeingTrial(2, (2,), float("inf")),)
    return Correction(seen.poses, "not_converged", "it did not come to rest", (2, 1), 2e-3, 1e-3, 13, tried=tried)


def test_every_row_has_every_key_and_is_json(rows: dict[str, dict[str, Any]]) -> None:
    keys = list(rows["oracle"])
    assert set(keys) == set(RECORD_FIELDS)
    for row in rows.values():
        assert list(row) == keys
        assert json.loads(json.dumps(row, allow_nan=False)) == row
        assert (row["schema"], row["env_id"]) == (RECORD_SCHEMA, ENV_ID)
        assert row["thresholds"]["placed_part_shift_mm"] == 1.0
        assert row["demonstration"] == "ok"


def test_correction_makes_the_difference(rows: dict[str, dict[str, Any]]) -> None:
    assert {method: row["success"] for method, row in rows.items()} == {
        "oracle": True,
        "uncorrected": False,
        "paper": True,
    }
    assert rows["uncorrected"]["failure_stage"] in outcomes.STAGES
    assert rows["uncorrected"]["failure_code"] in outcomes.CODES
    for method in ("oracle", "paper"):
        row = rows[method]
        assert (row["failure_stage"], row["failure_code"], row["failure_operation"]) == (None, None, None)
        assert not any(row["conditions"].values())
        assert row["gap_after_mm"] < 0.1
        assert row["pose_error_fixed_mm"] < 1.0


def test_the_row_says_what_was_foretold(rows: dict[str, dict[str, Any]]) -> None:
    """A careless human put castle 2 aside by 1.5 mm and more: the stick will not go in."""
    said = rows["uncorrected"]["failure_prediction"]
    assert (said["fails"], said["operation"], said["code"]) == (True, 3, "residual")
    assert said["size_mm"] > 1.0
    for method in ("oracle", "paper"):
        fits = rows[method]["failure_prediction"]
        assert (fits["fails"], fits["operation"], fits["code"]) == (False, None, "ok")
        assert fits["size_mm"] < 0.1
    assert [rows[method]["tried_corrections"] for method in rows] == [[], [], []]
    assert [rows[method]["extra_steps"] for method in rows] == [0, 0, 0]


def doubts(seen: Observation) -> Correction:
    """As the paper corrects, with a test that fails and names the first relation."""
    arcs = build_relation_graph(seen.assembly).arcs
    suspects = tuple(Suspect(a.name, a.contacts, a.made, 1.0, 3, 0.8 if a is arcs[0] else 0.0) for a in arcs)
    test = Consistency(30.0, 5, 1e-5, 0.01, suspects)
    return replace(correct(seen, "paper"), test=test, dropped=("R1",))


def test_the_row_says_what_the_correction_says_of_itself(
    scene: Scene, shown: SimulatedDemonstration, monkeypatch: pytest.MonkeyPatch, rows: dict[str, dict[str, Any]]
) -> None:
    monkeypatch.setattr("apo_bench.trial.planning.correct", lambda seen, method, look: doubts(seen))
    row = run_trial(replace(SPEC, method="paper"), scene, simulated=shown)
    assert (row["chi_square"], row["chi_square_dof"], row["p_value"]) == (30.0, 5, 1e-5)
    assert (row["consistent"], row["suspects"], row["dropped_contacts"]) == (False, ["R1"], ["R1"])
    for method in ("oracle", "uncorrected", "paper"):
        assert (rows[method]["consistent"], rows[method]["suspects"], rows[method]["chi_square"]) == (
            None,
            None,
            None,
        )
    assert [rows[method]["dropped_contacts"] for method in ("oracle", "uncorrected", "paper")] == [None, None, []]


def test_wrong_relations_are_told_and_noted(
    scene: Scene, shown: SimulatedDemonstration, rows: dict[str, dict[str, Any]]
) -> None:
    """Correctors meet them, nothing else does; robot and judge keep the right ones."""
    kinds = ("false-negative", "false-positive", "face-offset:3mm")
    told = {k: run_trial(replace(SPEC, method="paper", contact_source=k), scene, simulated=shown) for k in kinds}
    assert [told[k]["contact_source"] for k in kinds] == list(kinds)
    assert [told[k]["wrong_contact"] is None for k in kinds] == [True, False, False]
    assert rows["paper"]["wrong_contact"] is None
    assert told["face-offset:3mm"]["success"] is False
    raw = [rows["uncorrected"], run_trial(replace(SPEC, contact_source="face-offset:3mm"), scene, simulated=shown)]
    apart = {key for key in raw[0] if raw[0][key] != raw[1][key]}
    assert apart == {"contact_source", "config_hash"}


def test_a_noise_model_may_be_the_object_itself(scene: Scene, shown: SimulatedDemonstration) -> None:
    by_name = run_trial(SPEC, scene, simulated=shown, noise="isotropic")
    mine = make_noise("isotropic", NoiseLevel(SPEC.noise_mm, SPEC.noise_deg))
    own = run_trial(SPEC, scene, simulated=shown, noise=mine)
    assert {key for key in own if own[key] != by_name[key]} == {"noise", "config_hash"}
    assert own["noise"] == "session:IsotropicNoise"
    with pytest.raises(InputError, match="noise of run_trial must be a text, a function or None"):
        run_trial(SPEC, scene, noise=3)  # type: ignore[arg-type]


def test_the_hash_names_what_may_be_counted_together(scene: Scene) -> None:
    content = compute_content_hash(scene.scenario, "stick_in_tower", scene.arm.files)
    same = {
        compute_config_hash(replace(SPEC, method=m, seed=k), content) for m in ("uncorrected", "paper") for k in (0, 9)
    }
    assert len(same) == 1
    others = {"noise_mm": 2.0, "noise_deg": 2.0, "human_error_scale": 0.0, "clearance_mm": 0.5, "noise": "a:b"}
    others |= {"grasp": "friction", "arm": "a:b", "timestep_s": 0.0005}
    changed = {compute_config_hash(replace(SPEC, **{key: value}), content) for key, value in others.items()}
    assert len(changed | same) == len(others) + 1
    assert compute_config_hash(SPEC, content, "measured") not in same
    assert all(len(h) == 16 and int(h, 16) >= 0 for h in same)


def test_the_content_hash_follows_every_file(scene: Scene, tmp_path: Path) -> None:
    scenario = scene.scenario
    path = tmp_path / "stick_in_tower.toml"
    path.write_bytes((folder("scenarios") / "stick_in_tower.toml").read_bytes())
    first = compute_content_hash(scenario, "stick_in_tower", scene.arm.files)
    assert compute_content_hash(scenario, path, scene.arm.files) == first
    path.write_bytes(path.read_bytes() + b"# a word\n")
    arm = tmp_path / "arm.xml"
    arm.write_text("<mujoco/>")
    part = tmp_path / "castle.xml"
    part.write_bytes(scenario.part_files["castle1"].read_bytes() + b"\n")
    stricter = replace(scenario, thresholds=replace(scenario.thresholds, placed_part_shift_mm=0.5))
    wider = replace(scenario, clearance_mm=0.5)
    hashes = {
        first,
        compute_content_hash(scenario, path, scene.arm.files),
        compute_content_hash(scenario, "stick_in_tower", arm),
        compute_content_hash(
            replace(scenario, part_files={**scenario.part_files, "castle1": part}), "stick_in_tower", arm
        ),
        compute_content_hash(stricter, "stick_in_tower", scene.arm.files),
        compute_content_hash(scenario, scenario, scene.arm.files),
        compute_content_hash(wider, wider, scene.arm.files),
    }
    assert len(hashes) == 7


def test_a_row_without_replay_is_a_failure_with_null_physics(
    scene: Scene, shown: SimulatedDemonstration, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("apo_bench.trial.planning.correct", lambda seen, method, look: refuses(seen))
    row = run_trial(replace(SPEC, method="paper"), scene, simulated=shown)
    assert (row["success"], row["loose_success"], row["failure_stage"]) == (False, False, "correct")
    assert (row["corrected_operations"], row["gap_after_mm"]) == ([3, 2], None)
    assert row["tried_corrections"] == [{"step": 3, "free": [3], "gap_mm": None}]
    assert row["failure_prediction"] is row["extra_steps"] is None
    assert row["final_poses"] is row["sim_time_s"] is row["conditions"] is None


def test_a_demonstration_that_failed_is_excluded(scene: Scene, shown: SimulatedDemonstration) -> None:
    failed = SimulatedDemonstration(shown.layout, replace(shown.demonstration, code="demonstration_failed"))
    rows = [run_trial(replace(SPEC, method=m), scene, simulated=failed) for m in ("oracle", "uncorrected", "paper")]
    for row in rows:
        assert row["demonstration"] == "demonstration_failed"
        assert row["success"] is row["loose_success"] is None
        assert row["failure_stage"] == "demonstrate"


def test_a_measured_observation_has_no_truth(scene: Scene, shown: SimulatedDemonstration) -> None:
    seen = observed(scene, shown, 40.0)
    row = run_measured(replace(SPEC, method="uncorrected"), scene, seen, "text of the file")
    assert (row["noise_mm"], row["human_error_scale"], row["noise"], row["demonstration"]) == (
        None,
        None,
        "measured",
        "ok",
    )
    assert row["success"] is False
    assert row["pose_error_fixed_mm"] is row["pose_error_free_mm"] is None
    with pytest.raises(InputError, match=r"oracle.*truth is not known"):
        run_measured(replace(SPEC, method="oracle"), scene, seen, "")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"noise_deg": float("nan")}, "noise deg must be a number from 0 to 50, got nan"),
        ({"seed": LARGEST_SEED + 1}, "must be a whole number from 0"),
    ],
)
def test_a_specification_is_checked_at_the_door(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        TrialConfig(**(asdict(SPEC) | changes))


def observed(scene: Scene, shown: SimulatedDemonstration, noise_level: float = 1.0) -> Observation:
    return observe_demonstration(shown, make_noise("isotropic", NoiseLevel(noise_level, noise_level)), SPEC.seed)
