"""Three equations per contact say the same as one per vertex: the same sum of squares, the same normal equations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from apo_bench.assembly import Equations, placements, product
from apo_bench.assembly.equations import equations
from apo_bench.correction.solvers.compact import CompactEquations, compact_equations, moments
from apo_bench.geometry import Array, pose
from tests import scenes
from tests.assembly.test_equations import long_words, random_scene

pytestmark = pytest.mark.numeric

SEEDS = st.integers(0, 10**6)


def both(scene: scenes.Scene) -> tuple[Equations, CompactEquations]:
    system = equations(scene.assembly, scene.start, scene.goals)
    return system, compact_equations(system, len(scene.goals))


def dense(system: CompactEquations, T: Array) -> tuple[Array, Array]:
    """e, (3 c,), and the Jacobian by body twists, (3 c, 6 n)."""
    e, blocks = system.blocks(T, np.broadcast_to(np.eye(6), (*T.shape[:-2], 6, 6)))
    return e, np.swapaxes(system.gathered(blocks), -1, -2)


def check_same(scene: scenes.Scene, moved: Array) -> None:
    system, small = both(scene)
    e, J = system.linearised(moved)
    e3, J3 = dense(small, moved)
    assert len(small) == len(system.letters)
    assert_allclose(e3 @ e3, e @ e, rtol=1e-11, atol=1e-20)
    assert_allclose(J3.T @ e3, J.T @ e, rtol=0, atol=1e-11 * max(1.0, np.abs(J.T @ e).max(initial=0.0)))
    assert_allclose(J3.T @ J3, J.T @ J, rtol=0, atol=1e-11 * max(1.0, np.abs(J).max(initial=0.0) ** 2))
    assert_array_equal(small.residual(moved), e3)


@given(SEEDS)
@settings(max_examples=30, deadline=None)
def test_normal_equations_of_random_assemblies(seed: int) -> None:
    scene = random_scene(seed)
    check_same(scene, scenes.noisy(scene.goals, np.random.default_rng(seed), 20.0, 20.0))


@pytest.mark.parametrize("build", [long_words, *scenes.ALL.values()])
def test_normal_equations_of_examples(build: Callable[[], scenes.Scene]) -> None:
    scene = build()
    check_same(scene, scenes.noisy(scene.goals, np.random.default_rng(0), 5.0, 5.0))


def test_a_motion_parameter_that_occurs_twice_adds_up() -> None:
    scene = long_words()
    _, small = both(scene)
    twice = [c for c in range(len(small)) if np.count_nonzero(small.words.columns[c] == 2) == 2]
    assert twice
    T = scene.goals
    by = 1e-6
    _, J = dense(small, T)
    rows = (3 * np.array(twice)[:, None] + np.arange(3)).ravel()
    numeric = np.zeros((len(rows), 6))
    for i in range(6):
        sides = []
        for sign in (1.0, -1.0):
            moved = T.copy()
            moved[2] = moved[2] @ pose.exp(sign * by * np.eye(6)[i])
            sides.append(small.residual(moved)[rows])
        numeric[:, i] = (sides[0] - sides[1]) / (2 * by)
    assert np.abs(numeric).max() > 0.0
    assert_allclose(J[rows, 12:18], numeric, rtol=0, atol=1e-7)


@given(SEEDS)
@example(155837)  # parts that touch nothing
@settings(max_examples=20, deadline=None)
def test_coordinates_come_through_their_matrix(seed: int) -> None:
    """With twist = B z, the derivative by z is the one by the twist, times B."""
    scene = random_scene(seed)
    rng = np.random.default_rng(seed)
    _, small = both(scene)
    B = rng.standard_normal((len(scene.goals), 6, 6))
    _, J = dense(small, scene.goals)
    by_z = small.gathered(small.blocks(scene.goals, B)[1]).T
    expected = np.einsum("mka,kab->mkb", J.reshape(len(J), len(B), 6), B).reshape(J.shape)
    assert_allclose(by_z, expected, rtol=0, atol=1e-10 * max(1.0, np.abs(expected).max(initial=0.0)))


@pytest.mark.parametrize("lead", [(1,), (4,), (2, 3), (0,)])
def test_leading_axes_are_single_calls(lead: tuple[int, ...]) -> None:
    scene = scenes.pockets()
    rng = np.random.default_rng(1)
    _, small = both(scene)
    n = len(scene.goals)
    T = scene.goals @ pose.exp(0.01 * rng.standard_normal((*lead, n, 6)))
    B = rng.standard_normal((*lead, n, 6, 6))
    e, blocks = small.blocks(T, B)
    Jt = small.gathered(blocks)
    words = small.words.products(small.constants, T)
    assert Jt.shape == (*lead, 6 * n, 3 * len(small))
    for at in np.ndindex(lead):
        one_e, one_blocks = small.blocks(T[at], B[at])
        assert_allclose(e[at], one_e, rtol=0, atol=1e-15)
        assert_allclose(Jt[at], small.gathered(one_blocks), rtol=0, atol=1e-14)
        assert_allclose(words[at], small.words.products(small.constants, T[at]), rtol=0, atol=1e-15)
        assert_allclose(small.residual(T[at]), one_e, rtol=0, atol=1e-16)


def test_own_points_of_each_observation() -> None:
    """Points with a leading axis belong to the observations; `only` takes those that are asked for."""
    scene = scenes.stick_on_castles()
    rng = np.random.default_rng(2)
    T = np.array([scenes.noisy(scene.goals, rng, 3.0, 3.0) for _ in range(3)])
    each = [compact_equations(equations(scene.assembly, scene.start, goals), len(goals)) for goals in T]
    together = replace(each[0], points=np.array([one.points for one in each]))
    e = together.residual(T)
    for i, one in enumerate(each):
        assert_allclose(e[i], one.residual(T[i]), rtol=0, atol=1e-16)
    some = np.array([True, False, True])
    assert_allclose(together.only(some).residual(T[some]), e[some], rtol=0, atol=1e-16)
    assert each[0].only(some) is each[0]


@given(SEEDS)
@settings(max_examples=20, deadline=None)
def test_among_is_some_of_the_equations(seed: int) -> None:
    scene = random_scene(seed)
    rng = np.random.default_rng(seed)
    _, small = both(scene)
    moved = scenes.noisy(scene.goals, rng, 5.0, 5.0)
    kept = rng.random(len(small)) < 0.5
    rows = np.repeat(kept, 3)
    e, J = dense(small, moved)
    some_e, some_J = dense(small.among(kept), moved)
    assert len(small.among(kept)) == np.count_nonzero(kept)
    assert_allclose(some_e, e[rows], rtol=0, atol=1e-15)
    assert_allclose(some_J, J[rows], rtol=0, atol=1e-14)


@given(SEEDS)
@settings(max_examples=20, deadline=None)
def test_words_are_relative_poses(seed: int) -> None:
    scene = random_scene(seed)
    _, small = both(scene)
    assume(len(small))
    history = placements(scene.assembly, scene.start, scene.goals)
    words = small.words.products(small.constants, scene.goals)
    for (contact, made, _), word in zip(scene.assembly.relations(), words, strict=True):
        a, b = (history[made][end.part] for end in contact)
        assert_allclose(word, pose.inverse(a) @ b, rtol=0, atol=1e-12)


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


def test_the_word_of_a_contact_is_that_of_its_odls() -> None:
    scene = scenes.pockets()
    _, small = both(scene)
    last = scene.assembly.odls()[-1]
    words = small.words.products(small.constants, scene.goals)
    assert_allclose(words[-1], pose.inverse(product(last["cube3"], scene.goals)), atol=1e-15)


def test_no_contacts_and_no_operations() -> None:
    scene = scenes.stick_on_castles()
    _, small = both(scene)
    none = small.among(np.zeros(len(small), dtype=np.bool_))
    e, J = dense(none, scene.goals)
    assert (e.shape, J.shape) == ((0,), (0, 18))
    still = compact_equations(equations(scene.assembly.first(0), scene.start, np.zeros((0, 4, 4))), 0)
    assert (len(still), still.residual(np.zeros((0, 4, 4))).shape) == (0, (0,))
