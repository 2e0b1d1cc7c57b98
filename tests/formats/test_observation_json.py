"""The JSON forms: what is written is read back, and what is not right is refused in one sentence."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from apo_bench import InputError, Observation, Plan, load_scenario
from apo_bench.assembly import OutlierModel, SharedError, Step, Tails, correlate_first_order
from apo_bench.formats.observation_json import make_observation_form, read_json_observation
from apo_bench.formats.plan_json import make_plan_form
from apo_bench.geometry import pose

SCENARIO = load_scenario("stick_in_tower")
N = len(SCENARIO.assembly)
QUICK = settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def observation(seed: int = 0) -> Observation:
    """An observation with nothing round in it."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(N, 6, 6)) * np.repeat([1e-3, 2e-2], 3)[:, None]
    return Observation(
        assembly=SCENARIO.assembly,
        start=SCENARIO.start,
        poses=SCENARIO.nominal_poses @ pose.exp(rng.normal(size=(N, 6)) * np.repeat([0.1, 1.0], 3)),
        covariance=A @ np.swapaxes(A, 1, 2) + 1e-8 * np.eye(6),
        observed=rng.random(N) < 0.7,
        gap_m=float(rng.uniform(1e-5, 1e-3)),
        play_m=float(rng.uniform(0.0, 1e-3)),
    )


def form() -> dict[str, Any]:
    return make_observation_form(with_shared(observation()), "stick_in_tower")


def with_shared(seen: Observation) -> Observation:
    """With an error of each kind."""
    C = np.diag(np.repeat([1e-4, 2e-3], 3) ** 2)
    P = pose.at((0.1, 0.2, 0.9), (150.0, 20.0, -35.0))
    camera = SharedError("camera", (0, 2), C, P)
    drift = SharedError("drift", (1, 2), C, P, local=True, correlation=correlate_first_order(2, 0.9))
    four = np.array([1e-3, 4e-3, 0.02, 0.03])
    tails = Tails(seen.poses[:, :3, :3], four, np.array([2.0, 3.0, 1e9, 5.0]), 2.0 * four**2, np.array([0.05, 0.5]))
    return replace(seen, shared=(camera, drift, SharedError("castle1", (0,), C)), tails=tails)


def read(tmp_path: Path, document: Any) -> Observation:
    path = tmp_path / "seen.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    return read_json_observation(path, SCENARIO, (1.0, 1.0))[0]


def test_rates_of_outliers_come_back_and_may_be_left_out(tmp_path: Path) -> None:
    stated = replace(observation(), outliers=OutlierModel(0.24, 0.05, 8.0, 0.002))
    assert read(tmp_path, make_observation_form(stated, "stick_in_tower")).outliers == stated.outliers
    assert read(tmp_path, form()).outliers is None
    some = read(tmp_path, form() | {"outliers": {"gross_rate": 0.3}})
    assert some.outliers == OutlierModel(0.3)
    with pytest.raises(InputError, match=r"seen\.json, outliers: gross=1\.5 was given"):
        read(tmp_path, form() | {"outliers": {"gross_rate": 1.5}})
    with pytest.raises(InputError, match=r"unknown key 'gros_rate' .did you mean 'gross_rate'"):
        read(tmp_path, form() | {"outliers": {"gros_rate": 0.1}})


@QUICK
@given(seed=st.integers(0, 2**32))
def test_an_observation_comes_back(seed: int, tmp_path: Path) -> None:
    seen = observation(seed)
    back = read(tmp_path, make_observation_form(seen, "stick_in_tower"))
    np.testing.assert_allclose(back.poses, seen.poses, rtol=0, atol=1e-13)
    np.testing.assert_allclose(back.covariance, seen.covariance, rtol=1e-12, atol=0)
    assert back.observed.tolist() == seen.observed.tolist()
    assert back.gap_m == pytest.approx(seen.gap_m, rel=1e-12)
    assert back.play_m == pytest.approx(seen.play_m, rel=1e-12)
    assert set(back.start) == set(seen.start)
    for part, T in seen.start.items():
        np.testing.assert_allclose(back.start[part], T, rtol=0, atol=1e-13)


def test_a_plan_states_the_poses_of_steps_that_are_not_target_poses() -> None:
    schedule = (Step(0), Step(1), Step(1, undo=True), Step(1), Step(2))
    seen = observation().poses
    plan = Plan(SCENARIO.assembly, SCENARIO.start, seen[[0, 2, 2]], schedule, seen[[0, 1, 1, 2, 2]])
    form = make_plan_form(plan, "stick_in_tower")
    assert ["position_mm" in entry for entry in form["schedule"]] == [False, True, True, False, False]
    assert [entry["undo"] for entry in form["schedule"]] == [False, False, True, False, False]
    assert form["operations"][0]["position_mm"] == pytest.approx((1e3 * seen[0, :3, 3]).tolist())


def test_files_speak_mm_degrees_and_count_from_one() -> None:
    goals = SCENARIO.nominal_poses.copy()
    goals[2, :3, 3] = [0.1, -0.2, 0.3]
    covariance = np.tile(np.diag([1e-6] * 3 + [np.radians(2.0) ** 2] * 3), (N, 1, 1))
    seen = Observation(SCENARIO.assembly, SCENARIO.start, goals, covariance, np.ones(N, dtype=bool))
    entry = make_observation_form(seen, "stick_in_tower")["operations"][2]
    assert (entry["operation"], entry["part"]) == (3, "stick")
    assert entry["position_mm"] == pytest.approx([100.0, -200.0, 300.0])
    assert np.diag(entry["covariance_mm_deg"]) == pytest.approx([1.0] * 3 + [4.0] * 3)


def test_shared_errors_come_back_and_may_be_left_out(tmp_path: Path) -> None:
    seen = with_shared(observation())
    back = read(tmp_path, form())
    assert [one.name for one in back.shared] == ["camera", "drift", "castle1"]
    for one, other in zip(back.shared, seen.shared, strict=True):
        assert (one.operations, one.local) == (other.operations, other.local)
        for name in ("covariance", "frame", "correlation"):
            given = getattr(other, name)
            kept = getattr(one, name)
            assert (given is None) == (kept is None)
            if given is not None:
                np.testing.assert_allclose(kept, given, rtol=1e-9, atol=1e-13)
    assert back.tails is not None
    assert seen.tails is not None
    for name in ("frames", "scales", "freedom", "variances", "limits"):
        np.testing.assert_allclose(getattr(back.tails, name), getattr(seen.tails, name), rtol=1e-9, atol=1e-12)
    without = read(tmp_path, {key: value for key, value in form().items() if key not in ("shared", "tails")})
    assert (without.shared, without.tails) == ((), None)


def _set(*keys: Any, to: Any) -> Callable[[dict[str, Any]], None]:
    def edit(document: Any) -> None:
        for key in keys[:-1]:
            document = document[key]
        document[keys[-1]] = to

    return edit


def _lopsided(document: dict[str, Any]) -> None:
    document["operations"][0]["covariance_mm_deg"][0][1] += 1.0


BROKEN = {
    "another schema": (_set("schema", to="apo-bench/observation/3"), '"apo-bench/observation/2" is needed'),
    "shared by operation 4": (_set("shared", 0, "operations", to=[1, 4]), "operations from 1 to 3"),
    "shared, lopsided": (_set("shared", 1, "correlation", 0, 1, to=0.5), "with 1 on its diagonal is needed"),
    "tails of no axes": (_set("tails", "axes", 0, 0, 0, to=3.0), "a rotation matrix for each operation is needed"),
    "another scenario": (
        _set("scenario", to="stick_in_towr"),
        "the file is of 'stick_in_towr', not of 'stick_in_tower'",
    ),
    "a wrong part": (_set("operations", 0, "part", to="stick"), "state operation 1 of 'castle1'"),
    "far away": (_set("operations", 0, "position_mm", to=[1.0, 2.0, 1e200]), "position_mm 3: a number <= 10000000"),
    "a long quaternion": (_set("operations", 0, "quaternion_wxyz", to=[1.0, 0.1, 0.0, 0.0]), "length 1"),
    "a lopsided covariance": (_lopsided, "covariance_mm_deg: a symmetric"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_observation_is_refused_in_one_sentence(case: str, tmp_path: Path) -> None:
    edit, words = BROKEN[case]
    document = copy.deepcopy(form())
    edit(document)
    with pytest.raises(InputError) as refused:
        read(tmp_path, document)
    message = str(refused.value)
    assert words in message
    assert "\n" not in message
    assert message.endswith(".")
