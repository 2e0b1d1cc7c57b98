"""What is public answers arguments of a wrong type in one sentence, and takes a text for one name."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import apo_bench
from apo_bench.assembly import Outcome, Reached, Snapshot
from apo_bench.envs.apo_replay import APOReplay
from apo_bench.trial.stages import simulate_demonstration

NAMES = sorted(name for name in apo_bench.__all__ if name != "__version__")
ENVIRONMENTS = sorted(name for name in gymnasium.registry if name.startswith("APO"))
WRONG: tuple[Any, ...] = (None, 2, 1.5, "x", [1.5], [object()], object())


@pytest.fixture(scope="module")
def valid(castles: apo_bench.Scene, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Name of a parameter, or of a record -> what a function takes; with it, every function ends quickly."""
    settings = apo_bench.TrialSettings("stick_on_castles", abstain=1.0)
    simulated = simulate_demonstration(castles, settings.careless, settings.seed)
    shown = simulated.demonstration
    observation = apo_bench.observe(shown, "isotropic", np.random.default_rng(0))
    correction = apo_bench.correct(observation)
    after = tuple(Snapshot(shown.final, 0.0, 0.0, 0.0, True) for _ in shown.goals)
    reached = Reached(after, after[-1])
    reference = simulated.layout.goals
    folder = tmp_path_factory.mktemp("valid")
    rows = ["operation,part,x_mm,y_mm,z_mm,qw,qx,qy,qz"]
    rows += [f"{k},{each.main},0,0,30,1,0,0,0" for k, each in enumerate(observation.assembly.operations, start=1)]
    (folder / "seen.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    assembly = observation.assembly
    criteria = castles.criteria
    layout = simulated.layout
    grids = apo_bench.SweepSettings(("stick_on_castles",), (1.0,), (1.0,), ("contact",), trials=1, abstains=(1.0,))
    rng = np.random.default_rng(0)
    env = gymnasium.make("APOReplay-v0", scenario="stick_on_castles")
    result = apo_bench.ReplayResult(reached, Outcome("done", "ok", None, "done"), 0.0, 0.0)
    arm = castles.arm
    plan = correction.plan(observation)
    scenario = castles.scenario
    verdict = apo_bench.judge(assembly, reached, reference, criteria)
    records = {
        "Arm": arm,
        "Assembly": assembly,
        "ContactCorrector": apo_bench.ContactCorrector(),
        "Correction": correction,
        "Criteria": criteria,
        "Demonstration": shown,
        "Layout": layout,
        "Observation": observation,
        "Plan": plan,
        "ReplayResult": result,
        "Scenario": scenario,
        "Scene": castles,
        "SweepSettings": grids,
        "TrialSettings": settings,
        "Verdict": verdict,
    }
    files = {
        "read_arm.path": Path(apo_bench.__file__).parents[1] / "assets" / "arms" / "six_axis.toml",
        "read_observation.path": folder / "seen.csv",
        "out": folder / "rows",
    }
    small = {"width": 32, "height": 24, "most_s": 0.0, "look_at": np.zeros(3), "noise": "isotropic", "human_error": 1.0}
    given = dict(settings=settings, scene=castles, simulated=simulated, observation=observation, plan=plan, env=env)
    given |= dict(correction=correction, where=castles, assembly=assembly, reached=reached, reference=reference)
    given |= dict(criteria=criteria, layout=layout, grids=grids, rng=rng, scenario=scenario, observations=[observation])
    given |= dict(demonstration=shown, goals=correction.goals, poses=shown.final, given="stick_on_castles", args=())
    return records | files | small | given


def arguments(public: Callable[..., Any], name: str, valid: dict[str, Any]) -> dict[str, Any]:
    """Valid arguments of a function or record."""
    if name in valid:
        return {each.name: getattr(valid[name], each.name) for each in dataclasses.fields(valid[name])}
    found = {key: valid.get(f"{name}.{key}", valid.get(key)) for key in inspect.signature(public).parameters}
    return {key: value for key, value in found.items() if value is not None}


def complaints(call: Callable[[], Any], what: str) -> Iterator[str]:
    """What is wrong with how a call ends."""
    try:
        call()
    except apo_bench.InputError as error:
        sentence = str(error)
        if not sentence.strip() or "\n" in sentence or "object at 0x" in sentence:
            yield f"{what}: {sentence!r}"
    except Exception as error:
        if isinstance(error, TypeError) and "unexpected keyword argument" in str(error):
            return  # Python itself says that there is no such argument
        yield f"{what}: {error!r}"


@pytest.mark.parametrize("name", NAMES)
def test_a_wrong_argument_is_answered_in_one_sentence(
    name: str, valid: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    public = getattr(apo_bench, name)
    if name == "InputError":
        return
    right = arguments(public, name, valid)
    assert public(**right) is not None
    wrong = []
    for key in inspect.signature(public).parameters:
        for value in WRONG:
            wrong += complaints(lambda: public(**{**right, key: value}), f"{name}({key}={value!r})")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_an_environment_answers_a_wrong_argument_in_one_sentence(name: str) -> None:
    env: Any = gymnasium.make(name, scenario="stick_on_castles").unwrapped
    made = type(env)
    keys = {key for each in (made, *made.__bases__, APOReplay) for key in inspect.signature(each).parameters}
    wrong = []
    for value in WRONG:
        for key in sorted(keys):
            wrong += complaints(
                lambda: made(**{"scenario": "stick_on_castles", key: value}), f"{name}({key}={value!r})"
            )
        wrong += complaints(lambda: env.reset(seed=value), f"{name}.reset(seed={value!r})")
        wrong += complaints(lambda: env.reset(options=value), f"{name}.reset(options={value!r})")
        wrong += complaints(lambda: env.step(value), f"{name}.step({value!r})")
    assert not wrong, "\n".join(wrong)
