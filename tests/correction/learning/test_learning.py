"""Noise learned from observations alone: what was drawn comes back, and the likelihood is differentiated rightly."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from apo_bench import Demonstration, InputError, Observation, draw_layout, load_scenario
from apo_bench.cli.app import main
from apo_bench.correction.learning import likelihood
from apo_bench.correction.learning.likelihood import UNITS, ObservedErrors, readings
from apo_bench.files.json_forms import observation_form, write_form
from apo_bench.geometry import pose
from apo_bench.observation.fitting.fit import COMPONENTS, component_factors, view_ways
from apo_bench.observation.models.camera import ACROSS_SIGHT, ALONG_SIGHT, IN_IMAGE, OUT_OF_IMAGE, Camera
from apo_bench.observation.models.fitted import restated, view_frame
from apo_bench.observation.noise import Level, make_noise
from apo_bench.observation.noise_file import noise_text, read_noise
from apo_bench.trial.learned_noise import learn

CONSTANT = np.array([1.5, -1.0, 2.0, 1.0, -0.8, 0.5]) * UNITS
GROSS = 0.12


def shown(name: str, seed: int) -> Demonstration:
    scenario = load_scenario(name)
    layout = draw_layout(scenario, np.random.default_rng(seed), 0.0)
    n = len(layout.goals)
    return Demonstration(scenario.assembly, layout.start, layout.goals, layout.start, np.zeros((n, 6, 6)))


def seen(name: str, seed: int, *, gross: float = 0.0, constant: bool = False) -> tuple[Observation, int]:
    """By the model `camera` at level 1, which states three times the truth; how many operations are grossly wrong."""
    demonstration = shown(name, seed)
    rng = np.random.default_rng([seed, 1])
    made = make_noise("camera", Level(1.0, 1.0))(demonstration.assembly, demonstration, rng)
    goals = np.array(made.goals)
    n = len(made.goals)
    wrong = rng.random(n) < gross
    far = pose.exp(rng.uniform(-1.0, 1.0, (n, 6)) * np.repeat([0.3, 1.5], 3) + np.repeat([0.06, 0.3], 3))
    goals = np.where(wrong[:, None, None], goals @ far, goals)
    if constant:
        P = view_frame(Camera(), [goals])
        P[:3, 3] = 0.1, 0.0, 0.03
        goals = P @ pose.exp(CONSTANT) @ pose.inverse(P) @ goals
    return replace(made, goals=goals, covariance=9.0 * np.asarray(made.covariance)), int(wrong.sum())


@cache
def many(gross: float, constant: bool) -> tuple[list[Observation], float]:
    made = [
        seen(name, seed, gross=gross, constant=constant)
        for name in ("stick_in_tower", "pocket_table", "vanished_fixture")
        for seed in range(12)
    ]
    operations = sum(len(one.goals) for one, _ in made)
    return [one for one, _ in made], sum(wrong for _, wrong in made) / operations


def test_the_deviations_and_the_rate_of_outliers_come_back() -> None:
    """36 demonstrations: the truth is within four fifths of an interval beyond its ends, and intervals are short."""
    observations, realised = many(GROSS, False)
    found = learn(observations, Camera(), "made").noise
    for estimate, true in zip(found.deviations, (ACROSS_SIGHT, ALONG_SIGHT, OUT_OF_IMAGE, IN_IMAGE), strict=False):
        assert estimate.value == pytest.approx(true, rel=0.2)
        assert estimate.low < estimate.value < estimate.high < 1.5 * estimate.low
    assert found.deviations[4].low == found.deviations[5].low == 0.0
    assert found.gross.value == pytest.approx(realised, abs=0.04)


def test_a_constant_error_is_found_and_taken_out() -> None:
    observations, _ = many(0.0, True)
    found = learn(observations, Camera(), "made", constant=True)
    measured = found.measured
    assert measured.constant is not None
    for observation in observations[::7]:
        clean = restated(observation, measured, Camera())
        P = view_frame(Camera(), [observation.goals])
        P[:3, 3] = 0.1, 0.0, 0.03
        true = P @ pose.exp(-CONSTANT) @ pose.inverse(P) @ observation.goals
        off = pose.log(pose.inverse(true) @ clean.goals) / UNITS
        assert np.abs(off).max() < 1.0
        assert np.abs(pose.log(pose.inverse(true) @ observation.goals) / UNITS).max() > 1.5


def test_an_error_of_the_whole_view_is_told_from_those_of_operations() -> None:
    made = []
    for seed in range(20):
        demonstration = shown("pocket_table", seed)
        noise = make_noise("bias-view", Level(2.0, 2.0))
        made.append(noise(demonstration.assembly, demonstration, np.random.default_rng(seed)))
    found = learn(made, Camera(), "made")
    *own, shift, turn = found.noise.deviations
    assert shift.value == pytest.approx(2.0, rel=0.5)
    assert turn.value == pytest.approx(2.0, rel=0.5)
    assert all(estimate.value == pytest.approx(0.1, rel=0.4) for estimate in own)
    assert found.measured.view is not None


def test_the_slope_of_the_likelihood_is_that_of_its_values() -> None:
    camera = Camera()
    prepared = []
    for seed in range(3):
        observation, _ = seen("stick_in_tower", seed, gross=0.5)
        goals = np.array(shown("stick_in_tower", seed).goals)
        F = component_factors(camera, goals, view_frame(camera, [goals]))
        ways = view_ways(goals, view_frame(camera, [goals]))
        some = readings(observation, goals, [(), (1,), (0, 2)])
        prepared.append(likelihood._prepared(ObservedErrors(some, F, ways, 3)))
    x = np.array([0.1, 1.5, 0.4, -0.3, -2.0, 0.2, -1.0])
    c = 0.1 * np.arange(6.0)
    _, slope = likelihood._surprise(x, prepared, c)
    for j, step in enumerate(1e-5 * np.eye(len(x))):
        ends = [likelihood._surprise(x + sign * step, prepared, c)[0] for sign in (1, -1)]
        assert slope[j] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-4, abs=1e-5)


def test_the_file_is_a_noise_model_and_comes_back(tmp_path: Path) -> None:
    found = learn(many(0.0, True)[0][:12], Camera(), "made", constant=True)
    path = tmp_path / "cam.toml"
    path.write_text(noise_text(found.measured), encoding="utf-8")
    measured, _ = read_noise(path)
    assert_allclose([*measured.shift_mm.along], [*found.measured.shift_mm.along], rtol=1e-4)
    assert measured.constant is not None
    assert found.measured.constant is not None
    assert_allclose(measured.constant.twist, found.measured.constant.twist, rtol=1e-6, atol=1e-12)
    assert_allclose(measured.constant.frame, found.measured.constant.frame, rtol=0, atol=1e-8)
    demonstration = shown("stick_in_tower", 0)
    drawn = make_noise(str(path), Level(1.0, 1.0))(demonstration.assembly, demonstration, np.random.default_rng(0))
    assert drawn.goals.shape == demonstration.goals.shape


def test_the_commands_learn_and_use_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for i, observation in enumerate(many(0.0, True)[0][:12]):
        write_form(observation_form(observation, "stick_in_tower"), tmp_path / f"{i}.json")
    out = tmp_path / "cam.toml"
    assert main(["noise", "learn", str(tmp_path), "--constant", "--out", str(out)]) == 0
    assert "along the ray" in capsys.readouterr().out
    assert main(["noise", "learn", str(tmp_path), "--json"]) == 0
    form = json.loads(capsys.readouterr().out)
    assert [one["name"] for one in form["components"]] == [component.name for component in COMPONENTS]
    one = str(tmp_path / "0.json")
    assert main(["correct", "stick_in_tower", "--observation", one, "--camera-noise", str(out)]) == 0


def test_too_little_is_refused_in_one_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(InputError, match="2 observations were given, of which 2 can be corrected; at least 5"):
        learn(many(0.0, True)[0][:2], Camera(), "made")
    assert main(["noise", "learn", str(tmp_path)]) == 2
    assert "holds no .json file" in capsys.readouterr().err
    assert main(["noise", "learn", str(tmp_path / "none.json")]) == 2
