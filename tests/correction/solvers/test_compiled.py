"""The compiled solver is the plain one: the same goals after the same number of turns, whatever it is given."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from apo_bench import ContactCorrector, Observation, correct, correct_many, load_scenario
from apo_bench.assembly import build_contact_equations
from apo_bench.correction.contact.contact import contact
from apo_bench.correction.solvers import kernels
from apo_bench.correction.solvers.compact import CompactEquations, build_compact_equations
from apo_bench.correction.solvers.gauss_newton import NearestPoses, find_nearest_poses
from apo_bench.geometry import Array, pose
from tests.correction.test_many import check_same

by_kernels = partial(find_nearest_poses, kernels=kernels.kernels())
SCENARIOS = ("stick_on_castles", "vanished_fixture", "pocket_table")
LEVELS = {(2.0, 1.0): 1e-12, (10.0, 8.0): 1e-9}
"""Noise in mm and degrees, and how far goals may differ, [m]. At the larger one rounding grows on the way: the plain
solver differs from itself by up to 2e-10 m when the contacts come in another order."""


def drawn(name: str, mm: float, degrees: float, seed: int) -> tuple[CompactEquations, Array, Array]:
    """Equations, goals that were seen, and L, a different one for every operation."""
    rng = np.random.default_rng(seed)
    given = load_scenario(name)
    sigma = np.repeat([mm * 1e-3, np.radians(degrees)], 3) * rng.uniform(0.5, 1.5, size=(len(given.assembly), 1))
    twisted = np.tril(rng.normal(scale=0.2, size=(len(given.assembly), 6, 6)), -1) + np.eye(6)
    L = sigma[:, :, None] * twisted
    goals = given.nominal_poses @ pose.exp((L @ rng.standard_normal((*L.shape[:2], 1)))[..., 0])
    return build_compact_equations(build_contact_equations(given.assembly, given.start, goals), len(goals)), goals, L


def alike(expected: NearestPoses, actual: NearestPoses, within_m: float) -> None:
    assert len(expected.trace) == len(actual.trace)
    assert np.array_equal(expected.at_rest, actual.at_rest)
    assert np.array_equal(expected.finite, actual.finite)
    for name in ("poses", "z", "e", "Jt", "B", "at_rest", "finite"):
        assert getattr(expected, name).shape == getattr(actual, name).shape
    np.testing.assert_allclose(actual.poses, expected.poses, rtol=0, atol=within_m)
    np.testing.assert_allclose(actual.e, expected.e, rtol=0, atol=within_m)
    np.testing.assert_allclose(actual.B, expected.B, rtol=0, atol=1e2 * within_m)
    np.testing.assert_allclose(actual.Jt, expected.Jt, rtol=0, atol=1e2 * within_m)


@pytest.fixture(scope="module", autouse=True)
def _numba() -> None:
    pytest.importorskip("numba")


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("name", SCENARIOS)
def test_the_same_goals_after_as_many_turns(name: str, level: tuple[float, float]) -> None:
    for seed in range(3):
        given = drawn(name, *level, seed)
        alike(find_nearest_poses(*given), by_kernels(*given), LEVELS[level])


@pytest.mark.numeric
def test_what_is_not_finite_is_said_and_left_alone() -> None:
    system, goals, L = drawn("carried_bridge", 2.0, 1.0, 0)
    three = np.array([goals, goals, goals])
    three[1, 0, 0, 3] = np.nan
    with np.errstate(invalid="ignore"):
        found = by_kernels(system, three, np.array([L, L, L]))
    assert found.finite.tolist() == [True, False, True]
    assert np.array_equal(found.poses[1], three[1], equal_nan=True)
    assert not found.z[1].any()
    assert np.array_equal(found.poses[0], by_kernels(system, goals, L).poses)


def observed(name: str, mm: float, degrees: float, seed: int, play_m: float = 0.0) -> Observation:
    """An observation whose covariance is the one that it was drawn from."""
    given = load_scenario(name)
    _, goals, L = drawn(name, mm, degrees, seed)
    seen = np.ones(len(goals), dtype=np.bool_)
    return Observation(given.assembly, given.start, goals, L @ np.swapaxes(L, 1, 2), seen, play_m=play_m)


@pytest.mark.numeric
@pytest.mark.parametrize("play_m", [0.0, 2.5e-4])
def test_contact_is_compiled_by_default_and_says_what_it_says_uncompiled(play_m: float) -> None:
    for name in SCENARIOS:
        one = observed(name, 2.0, 1.0, 0, play_m)
        check_same((correct(one, "contact"),), [correct(one, ContactCorrector(compiled=False))])


def test_many_at_once_are_bit_for_bit_what_they_are_alone() -> None:
    first = observed("pocket_table", 2.0, 1.0, 0)
    seen = [replace(first, poses=observed("pocket_table", 2.0, 1.0, seed).poses) for seed in range(3)]
    for one, made in zip(seen, correct_many(seen, contact), strict=True):
        alone = correct(one, "contact")
        assert np.array_equal(made.poses, alone.poses)
        assert (made.covariance is None) == (alone.covariance is None)
        assert made.trace == alone.trace
        assert made.test == alone.test
