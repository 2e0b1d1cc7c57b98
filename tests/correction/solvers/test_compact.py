"""Three equations per contact say the same as one per vertex: the same sum of squares, the same normal equations."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from apo_bench.assembly import Equations, build_contact_equations
from apo_bench.correction.solvers.compact import CompactEquations, build_compact_equations, linearise_by, moments
from apo_bench.geometry import Array
from tests import scenes
from tests.assembly.test_equations import random_scene

pytestmark = pytest.mark.numeric

SEEDS = st.integers(0, 10**6)


def both(scene: scenes.Scene) -> tuple[Equations, CompactEquations]:
    system = build_contact_equations(scene.assembly, scene.start, scene.nominal_poses)
    return system, build_compact_equations(system, len(scene.nominal_poses))


def dense(system: CompactEquations, T: Array) -> tuple[Array, Array]:
    """e, (3 c,), and the Jacobian by body twists, (3 c, 6 n)."""
    e, Jt = linearise_by(system, T, np.broadcast_to(np.eye(6), (*T.shape[:-2], 6, 6)))
    return e, np.swapaxes(Jt, -1, -2)


def check_same(scene: scenes.Scene, moved: Array) -> None:
    system, small = both(scene)
    e, J = system.linearise(moved)
    e3, J3 = dense(small, moved)
    assert len(small) == len(system.letters)
    assert_allclose(e3 @ e3, e @ e, rtol=1e-11, atol=1e-20)
    assert_allclose(J3.T @ e3, J.T @ e, rtol=0, atol=1e-11 * max(1.0, np.abs(J.T @ e).max(initial=0.0)))
    assert_allclose(J3.T @ J3, J.T @ J, rtol=0, atol=1e-11 * max(1.0, np.abs(J).max(initial=0.0) ** 2))
    # a sum of products in another order: some units in the last place of the largest value
    assert_allclose(small.residual(moved), e3, rtol=0, atol=1e-14 * max(1.0, np.abs(e3).max(initial=0.0)))


@given(SEEDS)
@settings(max_examples=30, deadline=None)
def test_normal_equations_of_random_assemblies(seed: int) -> None:
    scene = random_scene(seed)
    check_same(scene, scenes.noisy(scene.nominal_poses, np.random.default_rng(seed), 20.0, 20.0))


@given(SEEDS, st.integers(3, 9))
@settings(max_examples=30, deadline=None)
def test_moments_are_those_of_the_corners(seed: int, corners: int) -> None:
    """The three rows have the number, the sum and the squares of the corners of a plane outline."""
    rng = np.random.default_rng(seed)
    plane = rng.standard_normal((2, 3))
    outline = rng.uniform(-1, 1, 3) + rng.uniform(-1, 1, (corners, 2)) @ plane
    vertex = np.concatenate([outline, outline[:3]])
    rows = moments(vertex, np.repeat([0, 1], [len(outline), 3]), 2)[0]
    homogeneous = np.column_stack([outline, np.ones(corners)])
    assert_allclose(rows.T @ rows, homogeneous.T @ homogeneous, rtol=0, atol=1e-12 * corners * 10)
