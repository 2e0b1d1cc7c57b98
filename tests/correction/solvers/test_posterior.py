"""What is still uncertain after a correction: ranks, free directions, and covariances that draws bear out."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from apo_bench import Correction, Observation, correct_many
from apo_bench.correction.contact.contact import contact
from apo_bench.correction.region import contains_truth
from apo_bench.correction.solvers.gauss_newton import find_nearest_poses
from apo_bench.correction.solvers.posterior import compute_freedom, compute_jacobian_rank
from apo_bench.geometry import Array, pose
from tests import scenes
from tests.correction.solvers.test_manifold import RANKS, crooked, jacobian, scales, system_of, twisted


def look(scene: scenes.Scene, L: Array, seed: int) -> Observation:
    goals = twisted(scene.nominal_poses, L, np.random.default_rng(seed))
    return replace(scenes.seen(scene, goals), covariance=L @ np.swapaxes(L, 1, 2))


@given(st.integers(0, 10**6), st.sampled_from(sorted(RANKS)))
@settings(max_examples=25, deadline=None)
def test_what_is_fixed_and_what_is_free_add_up(seed: int, name: str) -> None:
    scene = scenes.ALL[name]()
    rng = np.random.default_rng(seed)
    n = len(scene.nominal_poses)
    L = crooked(len(scene.nominal_poses), rng, 5.0, 3.0)
    seen = twisted(scene.nominal_poses, L, rng)
    system = system_of(scene, seen)
    found = find_nearest_poses(system, seen, L)
    known = compute_freedom(found.Jt)
    assert known is not None
    assert known.rank == compute_jacobian_rank(found.Jt) == RANKS[name]
    assert known.free.shape == (6 * n, 6 * n - RANKS[name])
    assert known.redundant == 3 * len(system) - RANKS[name]
    assert known.spectral_gap > 1e5
    assert_allclose(known.free.T @ known.free, np.eye(6 * n - RANKS[name]), rtol=0, atol=1e-12)
    J = jacobian(system, found)
    assert np.abs(J @ known.free).max() <= 1e-6 * np.abs(J).max()
    assert np.abs(found.z @ known.free).max() <= 1e-6


@pytest.mark.parametrize(("name", "correlated"), [("stick_in_tower", False), ("pockets", True)])
def test_the_stated_covariance_is_that_of_draws(name: str, correlated: bool) -> None:
    """Errors of corrected goals over 400 draws; what is stated to be fixed is fixed."""
    scene = scenes.ALL[name]()
    n = len(scene.nominal_poses)
    L = crooked(n, np.random.default_rng(1), 0.5, 0.5) if correlated else scales(n, 0.5, 0.5)
    errors = np.zeros((400, n, 6))
    stated = np.zeros((n, 6, 6))
    for seed, made in enumerate(correct_many([look(scene, L, seed) for seed in range(len(errors))], contact)):
        assert made.covariance is not None
        errors[seed] = pose.log(pose.inverse(made.poses) @ scene.nominal_poses)
        stated += made.covariance / len(errors)
    empirical = np.einsum("sni,snj->nij", errors, errors) / len(errors)
    deviation = np.sqrt(np.einsum("nii->ni", stated))
    largest = np.repeat([deviation[:, :3].max(), deviation[:, 3:].max()], 3)
    unit = np.maximum(deviation, 0.02 * largest)
    scaled = (empirical - stated) / (unit[:, :, None] * unit[:, None, :])
    assert np.abs(scaled).max() <= 0.25
    fixed = deviation < 1e-9
    assert fixed[0].tolist() == [False, False, True, True, True, False]
    assert np.abs(errors[:, fixed]).max() <= 1e-9


@cache
def corrected_towers() -> tuple[scenes.Scene, list[Observation], tuple[Correction, ...]]:
    """300 draws of one tower, for every level."""
    scene = scenes.stick_in_tower()
    L = scales(3, 1.0, 1.0)
    seen = [look(scene, L, seed) for seed in range(300)]
    return scene, seen, correct_many(seen, contact)


@pytest.mark.parametrize(("level", "low", "high"), [(0.95, 0.90, 0.99), (0.5, 0.41, 0.59)])
def test_regions_hold_the_truth_as_often_as_they_say(level: float, low: float, high: float) -> None:
    scene, seen, made = corrected_towers()
    held = [contains_truth(one, found, scene.nominal_poses, level) for one, found in zip(seen, made, strict=True)]
    assert len(held) == 300
    assert None not in held
    assert low <= np.mean(np.array(held, dtype=float)) <= high
