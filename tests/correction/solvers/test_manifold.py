"""The nearest point on the contact manifold: on it, nearest to what was seen, and the same from wherever one looks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import least_squares, minimize

from apo_bench.assembly import Equations, Operation
from apo_bench.assembly.equations import equations
from apo_bench.correction.solvers.compact import CompactEquations, compact_equations
from apo_bench.correction.solvers.gauss_newton import LARGEST_TURN, STEP, NearestGoals, nearest_goals, shortened_step
from apo_bench.correction.solvers.posterior import jacobian_rank
from apo_bench.geometry import Array, pose
from tests import scenes

pytestmark = pytest.mark.numeric

RANKS = {"bridge": 11, "stick_on_castles": 13, "stick_in_tower": 13, "pockets": 28}
LEVELS = [(2.0, 1.0), (5.0, 3.0), (10.0, 8.0)]
SEEDS = st.integers(0, 10**6)


def scales(n: int, mm: float, deg: float) -> Array:
    """L of independent noise along and about every axis, (n, 6, 6)."""
    return np.tile(np.diag(np.repeat([mm * 1e-3, np.radians(deg)], 3)), (n, 1, 1))


def crooked(n: int, rng: np.random.Generator, mm: float = 2.0, deg: float = 1.0) -> Array:
    """L of noise that is correlated and several times larger one way than another, different for every part."""
    turn = np.linalg.qr(rng.standard_normal((n, 6, 6)))[0]
    return scales(n, mm, deg) @ turn @ (np.exp(rng.uniform(-1.5, 1.5, (n, 6)))[:, :, None] * np.eye(6))


def system_of(scene: scenes.Scene, goals: Array) -> CompactEquations:
    return compact_equations(equations(scene.assembly, scene.start, goals), len(goals))


def twisted(goals: Array, L: Array, rng: np.random.Generator) -> Array:
    return np.asarray(goals @ pose.exp((L @ rng.standard_normal((len(goals), 6, 1)))[..., 0]))


def correction(seen: Array, goals: Array, L: Array) -> Array:
    """z of a change of goals, (6 n,)."""
    return np.asarray(np.linalg.solve(L, pose.log(pose.inverse(seen) @ goals)[..., None]).reshape(-1))


def jacobian(system: CompactEquations, found: NearestGoals) -> Array:
    """The derivative of e by z where the solver ended, (3 c, 6 n)."""
    return np.asarray(system.gathered(system.blocks(found.goals, found.B)[1]).T)


def drift(J: Array, z: Array, directions: int) -> float:
    """Length of what z has along directions that the contacts leave free."""
    return float(np.linalg.norm(np.linalg.svd(J)[2][directions:] @ z))


@pytest.mark.parametrize("seed", range(3))
def test_a_step_is_shortened_by_how_far_it_turns_a_goal_and_not_by_how_far_it_shifts_it(seed: int) -> None:
    """Metres do not count."""
    rng = np.random.default_rng(seed)
    L = np.stack([crooked(3, rng), crooked(3, rng)])
    step = np.linalg.solve(L, rng.standard_normal((2, 3, 6, 1)))[..., 0]
    for turned in (2.0 * LARGEST_TURN, 0.5 * LARGEST_TURN):
        twist = (L @ step[..., None])[..., 0]
        far = np.linalg.norm(twist[..., 3:], axis=-1).max(axis=1)
        asked = step * np.array([turned, 0.1 * LARGEST_TURN])[:, None, None] / far[:, None, None]
        made = [shortened_step(own.ravel(), each).reshape(3, 6) for own, each in zip(asked, L, strict=True)]
        assert_allclose(made[0], asked[0] * min(1.0, LARGEST_TURN / turned), rtol=1e-12)
        assert_array_equal(made[1], asked[1])


@pytest.mark.parametrize("name", RANKS)
@pytest.mark.parametrize("level", LEVELS)
def test_on_the_manifold_and_nearest(name: str, level: tuple[float, float]) -> None:
    scene = scenes.ALL[name]()
    n = len(scene.goals)
    L = scales(len(scene.goals), *level)
    for seed in range(10):
        seen = twisted(scene.goals, L, np.random.default_rng(seed))
        system = system_of(scene, seen)
        found = nearest_goals(system, seen, L)
        assert found.at_rest
        assert found.finite
        assert np.abs(equations(scene.assembly, scene.start, seen).residual(found.goals)).max() <= 1e-12
        J = jacobian(system, found)
        assert jacobian_rank(J.T) == jacobian_rank(found.Jt) == RANKS[name]
        assert drift(J, found.z, RANKS[name]) <= 1e-6
        assert_allclose(found.goals, seen @ pose.exp((L @ found.z.reshape(n, 6, 1))[..., 0]), rtol=0, atol=1e-14)
        truth = correction(seen, scene.goals, L)
        assert found.z @ found.z <= truth @ truth + 1e-9


@pytest.mark.parametrize("name", RANKS)
def test_correlated_noise_too(name: str) -> None:
    scene = scenes.ALL[name]()
    rng = np.random.default_rng(3)
    for _ in range(10):
        L = crooked(len(scene.goals), rng)
        seen = twisted(scene.goals, L, rng)
        system = system_of(scene, seen)
        found = nearest_goals(system, seen, L)
        assert found.at_rest
        assert np.abs(found.e).max() <= 1e-12
        assert drift(jacobian(system, found), found.z, RANKS[name]) <= 1e-6
        truth = correction(seen, scene.goals, L)
        assert found.z @ found.z <= truth @ truth + 1e-9


@pytest.mark.parametrize("name", scenes.ALL)
def test_consistent_goals_stay(name: str) -> None:
    scene = scenes.ALL[name]()
    n = len(scene.goals)
    for world in (np.eye(4), pose.at((0.2, -0.3, 0.0), (0.0, 0.0, 33.0))):
        moved = scenes.turned(scene, world)
        found = nearest_goals(system_of(moved, moved.goals), moved.goals, scales(n, 2.0, 1.0))
        assert found.at_rest
        assert_allclose(found.goals, moved.goals, rtol=0, atol=1e-15)


def test_the_derivative_is_one() -> None:
    """J of the result against differences of e by z."""
    scene = scenes.stick_in_tower()
    rng = np.random.default_rng(0)
    L = crooked(3, rng)
    seen = twisted(scene.goals, L, rng)
    system = system_of(scene, seen)
    found = nearest_goals(system, seen, L)
    by = 1e-4
    e = [
        [system.residual(seen @ pose.exp((L @ (found.z + sign * step).reshape(3, 6, 1))[..., 0])) for sign in (1, -1)]
        for step in by * np.eye(18)
    ]
    numeric = np.array([(plus - minus) / (2 * by) for plus, minus in e])
    assert_allclose(found.Jt, numeric, rtol=0, atol=1e-6 * np.abs(numeric).max())


@given(SEEDS)
@settings(max_examples=15, deadline=None)
def test_the_world_frame_does_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scene = scenes.stick_in_tower()
    L = crooked(3, rng)
    seen = twisted(scene.goals, L, rng)
    world = pose.exp(rng.standard_normal(6))
    moved = scenes.turned(scenes.Scene(scene.assembly, scene.start, seen), world)
    a = nearest_goals(system_of(scene, seen), seen, L)
    b = nearest_goals(system_of(moved, moved.goals), moved.goals, L)
    assert_allclose(b.goals, world @ a.goals, rtol=0, atol=1e-9)
    assert_allclose(b.z, a.z, rtol=0, atol=1e-6)


@given(SEEDS, st.sampled_from([0.1, 3.0, 20.0]))
@settings(max_examples=15, deadline=None)
def test_only_the_shape_of_the_noise_matters(seed: int, factor: float) -> None:
    rng = np.random.default_rng(seed)
    scene = scenes.stick_on_castles()
    L = crooked(3, rng)
    seen = twisted(scene.goals, L, rng)
    a, b = (nearest_goals(system_of(scene, seen), seen, scale) for scale in (L, factor * L))
    resting = 10.0 * STEP * max(1.0, factor)  # the solver rests within `STEP` of the noise that it was told
    assert_allclose(factor * b.z, a.z, rtol=0, atol=resting)
    assert_allclose(b.goals, a.goals, rtol=0, atol=resting * np.abs(L).max())


@given(SEEDS)
@settings(max_examples=10, deadline=None)
def test_any_root_of_the_covariance_will_do(seed: int) -> None:
    """L and L Q, Q orthogonal, state the same noise."""
    rng = np.random.default_rng(seed)
    scene = scenes.bridge()
    L = crooked(3, rng)
    seen = twisted(scene.goals, L, rng)
    Q = np.linalg.qr(rng.standard_normal((3, 6, 6)))[0]
    a, b = (nearest_goals(system_of(scene, seen), seen, scale) for scale in (L, L @ Q))
    assert_allclose(b.goals, a.goals, rtol=0, atol=1e-8)
    assert_allclose((Q @ b.z.reshape(3, 6, 1)).ravel(), a.z, rtol=0, atol=1e-5)


@pytest.mark.slow
def test_slsqp_finds_the_same_where_nothing_is_redundant() -> None:
    """A block on a block on the table, 6 equations of 12 unknowns: three vertices per contact, of the plain ones."""
    operations = [
        Operation("B", scenes.touch("B", "table", "nz-top")),
        Operation("A", scenes.touch("A", "B", "nz-pz")),
    ]
    parts = [scenes.table(), scenes.block("B"), scenes.block("A")]
    scene = scenes.scene(parts, operations, [scenes.mm(0, 0, 25), scenes.mm(0, 0, 75)])
    rng = np.random.default_rng(7)
    for _ in range(4):
        L = crooked(2, rng, 5.0, 3.0)
        seen = twisted(scene.goals, L, rng)
        plain = equations(scene.assembly, scene.start, seen)

        def e(z: Array, seen: Array = seen, L: Array = L, plain: Equations = plain) -> Array:
            return np.asarray(
                1e3 * plain.residual(seen @ pose.exp((L @ z.reshape(2, 6, 1))[..., 0]))[[0, 1, 2, 4, 5, 6]]
            )

        found = nearest_goals(system_of(scene, seen), seen, L)
        other = minimize(
            lambda z: float(z @ z),
            np.zeros(12),
            jac=lambda z: 2 * z,
            constraints={"type": "eq", "fun": e},
            method="SLSQP",
            options={"ftol": 1e-14, "maxiter": 500},
        )
        assert np.abs(e(other.x)).max() < 1e-6
        assert found.z @ found.z == pytest.approx(other.fun, rel=1e-6)
        assert_allclose(found.z, other.x, rtol=0, atol=1e-3)


@pytest.mark.parametrize("name", ["bridge", "stick_in_tower"])
def test_ever_stiffer_springs_lead_to_the_same(name: str) -> None:
    """Redundant contacts as penalties, made ten times stiffer again and again, started from the answer before."""
    scene = scenes.ALL[name]()
    rng = np.random.default_rng(11)
    n = 3
    L = crooked(3, rng)
    seen = twisted(scene.goals, L, rng)
    plain = equations(scene.assembly, scene.start, seen)

    def pulls(z: Array, soft_m: float) -> Array:
        return np.concatenate([z, plain.residual(seen @ pose.exp((L @ z.reshape(n, 6, 1))[..., 0])) / soft_m])

    z = np.zeros(6 * n)
    for soft_m in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
        z = least_squares(pulls, z, args=(soft_m,), xtol=1e-15, ftol=1e-15, gtol=1e-12).x
    found = nearest_goals(system_of(scene, seen), seen, L)
    assert found.z @ found.z == pytest.approx(z @ z, rel=1e-5)
    assert_allclose(found.z, z, rtol=0, atol=1e-3)


@pytest.mark.parametrize("name", RANKS)
def test_many_at_once_are_one_after_the_other(name: str) -> None:
    scene = scenes.ALL[name]()
    rng = np.random.default_rng(5)
    n = len(scene.goals)
    system = system_of(scene, scene.goals)
    L = np.array([crooked(n, rng, *level) for level in (*LEVELS, (0.01, 0.01), (2.0, 1.0), (2.0, 1.0))])
    seen = np.array([twisted(scene.goals, scale, rng) for scale in L])
    seen[3] = scene.goals
    found = nearest_goals(system, seen, L)
    assert found.at_rest.shape == (6,)
    for i in range(6):
        one = nearest_goals(system, seen[i], L[i])
        assert_allclose(found.goals[i], one.goals, rtol=0, atol=1e-10)
        assert_allclose(found.z[i], one.z, rtol=0, atol=1e-6)
        assert found.at_rest[i]
        assert found.finite[i]
        assert one.at_rest
    shared = nearest_goals(system, seen, L[0])
    assert_allclose(shared.goals[1], nearest_goals(system, seen[1], L[0]).goals, rtol=0, atol=1e-10)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_are_left_alone(wrong: float) -> None:
    scene = scenes.stick_on_castles()
    rng = np.random.default_rng(0)
    L = scales(3, 2.0, 1.0)
    seen = np.array([twisted(scene.goals, L, rng) for _ in range(3)])
    system = system_of(scene, scene.goals)
    good = nearest_goals(system, seen, L)
    seen[1, 2, 0, 3] = wrong
    with np.errstate(invalid="ignore"):
        found = nearest_goals(system, seen, L)
        alone = nearest_goals(system, seen[1], L)
    assert found.finite.tolist() == [True, False, True]
    assert found.at_rest.tolist() == [True, False, True]
    assert_array_equal(found.goals[1], seen[1])
    assert_array_equal(found.z[1], np.zeros(18))
    assert_allclose(found.goals[[0, 2]], good.goals[[0, 2]], rtol=0, atol=1e-12)
    assert not alone.finite
    assert_array_equal(alone.goals, seen[1])


def test_without_contacts_nothing_changes() -> None:
    scene = scenes.stick_on_castles()
    rng = np.random.default_rng(0)
    L = crooked(3, rng)
    seen = twisted(scene.goals, L, rng)
    system = system_of(scene, seen)
    for some in (seen, seen[None], np.array([seen, scene.goals])):
        found = nearest_goals(system.among(np.zeros(len(system), dtype=np.bool_)), some, L)
        assert found.at_rest.all()
        assert_array_equal(found.goals, some)
        assert not found.z.any()


def test_no_operations_and_no_observations() -> None:
    scene = scenes.stick_on_castles()
    none = np.zeros((0, 4, 4))
    found = nearest_goals(
        compact_equations(equations(scene.assembly.first(0), scene.start, none), 0), none, np.zeros((0, 6, 6))
    )
    assert (found.goals.shape, found.z.shape, bool(found.at_rest)) == ((0, 4, 4), (0,), True)
    nobody = nearest_goals(system_of(scene, scene.goals), np.zeros((0, 3, 4, 4)), scales(3, 1.0, 1.0))
    assert (nobody.goals.shape, nobody.z.shape, nobody.at_rest.shape) == ((0, 3, 4, 4), (0, 18), (0,))


@pytest.mark.parametrize("name", ["bridge", "stick_on_castles", "pockets"])
def test_soft_contacts_balance_the_noise(name: str) -> None:
    """The gradient of |z|^2 + |e / soft|^2 vanishes; contacts that are demanded hold."""
    scene = scenes.ALL[name]()
    rng = np.random.default_rng(4)
    n = len(scene.goals)
    for demanded in (0.0, 0.5):
        L = crooked(n, rng)
        seen = twisted(scene.goals, L, rng)
        system = system_of(scene, seen)
        hard = np.repeat(rng.random(len(system)) < demanded, 3)
        soft_m = np.where(hard, 0.0, rng.uniform(0.1e-3, 2e-3, len(hard)))
        found = nearest_goals(system, seen, L, soft_m)
        assert found.at_rest
        assert np.abs(found.e[hard]).max(initial=0.0) <= 1e-11
        assert np.abs(found.e[~hard]).max() > 1e-6
        J = jacobian(system, found)
        gradient = found.z + J[~hard].T @ (found.e[~hard] / soft_m[~hard] ** 2)
        free = np.linalg.svd(J[hard])[2][jacobian_rank(J[hard].T) :] if hard.any() else np.eye(6 * n)
        assert np.linalg.norm(free @ gradient) <= 1e-4 * np.linalg.norm(found.z)


def test_softer_contacts_are_followed_less() -> None:
    scene = scenes.stick_in_tower()
    rng = np.random.default_rng(9)
    L = scales(3, 2.0, 1.0)
    seen = twisted(scene.goals, L, rng)
    system = system_of(scene, seen)
    found = [nearest_goals(system, seen, L, np.full(3 * len(system), soft)) for soft in (1e-2, 1e-3, 1e-4, 1e-6)]
    lengths = [float(one.z @ one.z) for one in found] + [float(np.sum(nearest_goals(system, seen, L).z ** 2))]
    left = [float(np.abs(one.e).max()) for one in found]
    assert lengths == sorted(lengths)
    assert left == sorted(left, reverse=True)
    assert lengths[-1] == pytest.approx(lengths[-2], rel=1e-3)
