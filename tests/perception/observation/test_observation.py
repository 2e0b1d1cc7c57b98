"""Noise: its distribution, its frame, what it states about itself, and what `observe` refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from apo_bench import Demonstration, InputError, Observation, observe
from apo_bench.geometry import pose
from apo_bench.perception.observation.models.displacement import COVARIANCE_FLOOR, floor_covariance
from apo_bench.perception.observation.models.isotropic import IsotropicNoise
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from tests import scenes

pytestmark = pytest.mark.numeric

TOWER = scenes.turned(scenes.stick_in_tower(), pose.at((0.1, -0.02, 0.0), (0.0, 0.0, 23.0)))


@pytest.mark.parametrize("seed", range(2))
def test_the_floor_keeps_covariances_positive_definite(seed: int) -> None:
    rng = np.random.default_rng(seed)
    axis = rng.standard_normal(6) * COVARIANCE_FLOOR * 20
    C = np.outer(axis, axis)[None]
    raised = floor_covariance(C)
    assert_array_equal(raised, np.swapaxes(raised, 1, 2))
    unit = np.outer(COVARIANCE_FLOOR, COVARIANCE_FLOOR)
    assert np.linalg.eigvalsh(raised[0] / unit).min() > 1 - 1e-9
    assert np.linalg.eigvalsh((raised - C)[0] / unit).min() > -1e-9
    assert (np.sqrt(np.diagonal(raised[0])) >= COVARIANCE_FLOOR * (1 - 1e-12)).all()


def test_observe_passes_on_the_topology_the_starts_and_the_threshold() -> None:
    shown = replace(scenes.shown(TOWER), gap_m=3e-4, play_m=2e-4)
    seen = observe(shown, IsotropicNoise(NoiseLevel(1.0, 1.0)), np.random.default_rng(0))
    assert seen.assembly is shown.assembly
    assert dict(seen.start).keys() == dict(shown.start).keys()
    assert seen.observed.tolist() == [True, True, True]
    assert (seen.gap_m, seen.play_m) == (3e-4, 2e-4)


def test_make_noise_by_name_class_function_and_object() -> None:
    noise_level = NoiseLevel(2.0, 1.0)
    rng = np.random.default_rng(0)

    def plain(assembly: object, shown: Demonstration, rng: np.random.Generator) -> Observation:
        return scenes.seen(TOWER, shown.poses)

    assert make_noise("isotropic", noise_level) == IsotropicNoise(noise_level)
    assert make_noise(
        "apo_bench.perception.observation.models.isotropic:IsotropicNoise", noise_level
    ) == IsotropicNoise(noise_level)
    assert make_noise(IsotropicNoise, noise_level) == IsotropicNoise(noise_level)
    assert make_noise(IsotropicNoise(NoiseLevel(9.0, 9.0)), noise_level) == IsotropicNoise(NoiseLevel(9.0, 9.0))
    assert make_noise(plain, noise_level) is plain
    assert_array_equal(observe(scenes.shown(TOWER), plain, rng).poses, TOWER.nominal_poses)


@pytest.mark.parametrize(
    ("given", "noise_level", "message"),
    [
        ("isotropic", NoiseLevel(1, float("nan")), "noise level nan degrees is not possible"),
        (lambda goals: goals, NoiseLevel(1, 1), "cannot be called with (assembly, shown, rng)"),
    ],
)
def test_what_make_noise_refuses(given: object, noise_level: NoiseLevel, message: str) -> None:
    with pytest.raises(InputError) as refused:
        make_noise(given, noise_level)
    assert message in str(refused.value)


GOOD = scenes.seen(TOWER, TOWER.nominal_poses)


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        (scenes.seen(scenes.stick_in_tower(), TOWER.nominal_poses), "changed the assembly"),
        (replace(GOOD, poses=1.1 * TOWER.nominal_poses), "pose of operation 1 that is not rigid"),
    ],
)
def test_what_observe_refuses(returned: object, message: str) -> None:
    with pytest.raises(InputError, match="the noise model 'mine'") as refused:
        observe(scenes.shown(TOWER), named(lambda *_: returned), np.random.default_rng(0))
    assert message in str(refused.value)


def named(noise):
    noise.__name__ = "mine"
    return noise
