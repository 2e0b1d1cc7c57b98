"""Plain functions as noise models, and the commands that list noise models and print their cards."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from apo_bench import observe
from apo_bench.cli.app import main
from apo_bench.geometry import Array
from apo_bench.perception.observation.function_noise import FunctionNoise
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.viz.noise_sheet import find_facts, list_models
from tests import scenes

TOWER = scenes.stick_in_tower()
SHOWN = scenes.shown(TOWER)
NOISE_LEVEL = NoiseLevel(1.0, 1.0)


def lifted(goals: Array, rng: np.random.Generator) -> Array:
    """Everything is seen too high, by a millimetre or two."""
    goals[:, 2, 3] += rng.uniform(1e-3, 2e-3, len(goals))
    return goals


def with_deviations(function, mm: object, deg: object):
    def noise(goals, rng):
        return function(goals, rng)

    noise.deviation_mm = mm
    noise.deviation_deg = deg
    return noise


@pytest.mark.parametrize("wrap", [lambda: with_deviations(lifted, 2.0, 0.5), lambda: FunctionNoise(lifted, 2.0, 0.5)])
def test_goals_and_declared_deviations_become_an_observation(wrap) -> None:
    before = TOWER.nominal_poses.copy()
    seen = observe(SHOWN, make_noise(wrap(), NOISE_LEVEL), np.random.default_rng(4))
    up = np.random.default_rng(4).uniform(1e-3, 2e-3, 3)
    assert_allclose(seen.poses[:, 2, 3] - TOWER.nominal_poses[:, 2, 3], up, atol=1e-15)
    assert_allclose(seen.covariance, np.tile(np.diag(np.repeat([2e-3, np.radians(0.5)], 3) ** 2), (3, 1, 1)))
    assert seen.observed.all()
    assert_array_equal(TOWER.nominal_poses, before)


def test_every_model_with_a_name_is_listed_and_says_what_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["noise", "list"]) == 0
    listing = capsys.readouterr().out
    for name, title in list_models().items():
        assert f"{name} " in listing
        assert title in listing
        about = find_facts(name)
        assert about.formula
        assert about.frame
        assert about.states
