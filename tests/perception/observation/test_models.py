"""Noise that is not the same everywhere: the camera's line of sight, and parts that are seen worse than others."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from apo_bench import Observation, observe
from apo_bench.geometry import Array, pose
from apo_bench.perception.observation.models.isotropic import IsotropicNoise, PerPartNoise, draw_part_factors
from apo_bench.perception.observation.noise import Noise, NoiseLevel
from tests import scenes

TOWER = scenes.turned(scenes.stick_in_tower(), pose.at((0.1, -0.02, 0.0), (20.0, 35.0, 23.0)))
NOISE_LEVEL = NoiseLevel(3.0, 6.0)


def see(noise: Noise, seed: int) -> Observation:
    return observe(scenes.shown(TOWER), noise, np.random.default_rng(seed))


def twists(seen: Observation, shown: Array) -> Array:
    """Body twists by which goals are wrong, (n, 6)."""
    return pose.log(pose.inverse(shown) @ seen.poses)


def test_a_part_is_as_bad_in_every_operation() -> None:
    """The error of each operation is that of `isotropic` times the factor of the part it moves."""
    plain = see(IsotropicNoise(NOISE_LEVEL), 8)
    seen = see(PerPartNoise(NOISE_LEVEL), 8)
    ratio = twists(seen, TOWER.nominal_poses) / twists(plain, TOWER.nominal_poses)
    assert_allclose(ratio, np.tile(ratio[:, :1], (1, 6)), rtol=1e-6)
    rng = np.random.default_rng(8)
    rng.standard_normal((3, 6))
    factor = draw_part_factors(TOWER.assembly.solids, rng)
    assert_allclose(ratio[:, 0], [factor[o.main] for o in TOWER.assembly.operations], rtol=1e-6)
    assert_allclose(seen.covariance, ratio[:, :1, None] ** 2 * plain.covariance, rtol=1e-6)
