"""What is public answers arguments of a wrong type in one sentence, and takes a text for one name."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import trimesh

import apo_bench
from apo_bench.assembly import Outcome, ReachedState, Snapshot
from apo_bench.envs.apo_replay import APOReplay
from apo_bench.resources import folder
from apo_bench.simulation.execution.config import ExecutionConfig
from apo_bench.trial.trial_stages import simulate_demonstration

SCENARIO = "stick_on_castles"
NAMES = sorted(name for name in apo_bench.__all__ if name not in ("__version__", "InputError", "RateTable", "evaluate"))
ENVIRONMENTS = sorted(name for name in gymnasium.registry if name.startswith("APO"))
WRONG: tuple[Any, ...] = (None, 2, 1.5, "x", [1.5], [object()], object())


@pytest.fixture(scope="module")
def valid(castles: apo_bench.Scene, tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Any]:
    """Name of a parameter, or of a record -> what is right; every function that is given all of it ends quickly."""
    settings = apo_bench.TrialConfig(SCENARIO, min_predicted_success=1.0)
    simulated = simulate_demonstration(castles, settings.human_error_scale, settings.seed)
    shown = simulated.demonstration
    assembly = shown.assembly
    observation = apo_bench.observe(shown, "isotropic", np.random.default_rng(0))
    correction = apo_bench.correct(observation)
    at_rest = Snapshot(shown.final, 0.0, 0.0, 0.0, True)
    reached = ReachedState((at_rest,) * len(assembly), at_rest)
    reference = simulated.layout.poses
    made = tmp_path_factory.mktemp("valid")
    rows = [f"{k},{each.main},0,0,30,1,0,0,0" for k, each in enumerate(assembly.operations, start=1)]
    (made / "seen.csv").write_text("\n".join(["operation,part,x_mm,y_mm,z_mm,qw,qx,qy,qz", *rows]), encoding="utf-8")
    blocks = [
        trimesh.creation.box((30, 30, 20), trimesh.transformations.translation_matrix((0, 0, z))) for z in (10, 30)
    ]
    trimesh.util.concatenate(blocks).export(made / "blocks.stl")
    records = {
        "Arm": castles.arm,
        "Assembly": assembly,
        "ContactCorrector": apo_bench.ContactCorrector(),
        "Correction": correction,
        "Criteria": castles.criteria,
        "Demonstration": shown,
        "Layout": simulated.layout,
        "Observation": observation,
        "Plan": correction.plan(observation),
        "ReplayResult": apo_bench.ReplayResult(reached, Outcome("done", "ok", None, "done"), 0.0, 0.0),
        "Scenario": castles.scenario,
        "Scene": castles,
        "SweepConfig": apo_bench.SweepConfig(
            (SCENARIO,), (1.0,), (1.0,), ("contact",), trials=1, min_predicted_success=(1.0,)
        ),
        "TrialConfig": settings,
        "Verdict": apo_bench.judge(assembly, reached, reference, castles.criteria),
    }
    by_record = {
        "arm": "Arm",
        "assembly": "Assembly",
        "correction": "Correction",
        "criteria": "Criteria",
        "demonstration": "Demonstration",
        "layout": "Layout",
        "observation": "Observation",
        "plan": "Plan",
        "scenario": "Scenario",
        "scene": "Scene",
        "where": "Scene",
        "grids": "SweepConfig",
        "run_trial.config": "TrialConfig",
    }
    others = {
        "simulated": simulated,
        "observations": [observation],
        "reached": reached,
        "reference": reference,
        "poses": shown.final,
        "explain.poses": reference,
        "rng": np.random.default_rng(0),
        "human_error": 1.0,
        "env": gymnasium.make("APOReplay-v0", scenario=SCENARIO),
        "noise": "isotropic",
        "given": SCENARIO,
        "look_at": np.zeros(3),
        "width": 32,
        "height": 24,
        "most_s": 0.0,
        "out": made / "rows",
        "replay.config": ExecutionConfig("near-contact"),
        "check_scenario.seeds": 0,
        "evaluate_policy.env": gymnasium.make("APOInsert-v0", scenario=SCENARIO),
        "evaluate_policy.policy": "straight",
        "evaluate_policy.trials": [0],
        "check_scenario.fidelity": "near-contact",
        "import_part.file": made / "blocks.stl",
        "import_part.folder": made / "parts",
        "import_part.unit": "mm",
        "import_assembly.files": made / "blocks.stl",
        "import_assembly.unit": "mm",
        "import_assembly.out": made / "blocks.toml",
        "save_scenario.folder": made / "saved",
        "read_observation.path": made / "seen.csv",
        "read_arm.path": folder("assets") / "arms" / "six_axis.toml",
    }
    return {**records, **{name: records[record] for name, record in by_record.items()}, **others}


def right_arguments(public: Callable[..., Any], name: str, valid: Mapping[str, Any]) -> dict[str, Any]:
    """Arguments that a function or record takes."""
    if name in valid:
        return {each.name: getattr(valid[name], each.name) for each in dataclasses.fields(valid[name])}
    found = {key: valid.get(f"{name}.{key}", valid.get(key)) for key in inspect.signature(public).parameters}
    return {key: value for key, value in found.items() if value is not None}


def complaints(public: Callable[..., Any], right: Mapping[str, Any], key: str) -> Iterator[str]:
    """What is wrong with how a function answers wrong values of one argument."""
    for value in WRONG:
        called = f"{public.__qualname__}({key}={value!r})"
        try:
            public(**{**right, key: value})
        except (apo_bench.InputError, gymnasium.error.ResetNeeded) as error:
            sentence = str(error)
            if not sentence.strip() or "\n" in sentence or "object at 0x" in sentence:
                yield f"{called}: {sentence!r}"
        except Exception as error:
            # Python itself says that there is no such argument.
            if not isinstance(error, TypeError) or "unexpected keyword argument" not in str(error):
                yield f"{called}: {error!r}"


@pytest.mark.parametrize("name", NAMES)
def test_a_wrong_argument_is_answered_in_one_sentence(
    name: str, valid: Mapping[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    public = getattr(apo_bench, name)
    right = right_arguments(public, name, valid)
    if "width" not in right:  # pictures need a graphics driver, and say so
        assert public(**right) is not None
    wrong = [each for key in inspect.signature(public).parameters for each in complaints(public, right, key)]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_an_environment_answers_a_wrong_argument_in_one_sentence(name: str) -> None:
    right = {"scenario": SCENARIO}
    env: Any = gymnasium.make(name, **right).unwrapped
    made = type(env)
    keys = {key for each in (made, *made.__bases__, APOReplay) for key in inspect.signature(each).parameters}
    wrong = [each for key in sorted(keys) for each in complaints(made, right, key)]
    wrong += [each for key in ("seed", "options") for each in complaints(env.reset, {}, key)]
    wrong += complaints(env.step, {}, "action")
    assert not wrong, "\n".join(wrong)
