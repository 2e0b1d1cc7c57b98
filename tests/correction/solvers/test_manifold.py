"""The nearest point on the contact manifold: on it, nearest to what was seen, and the same from wherever one looks."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from apo_bench.assembly import build_contact_equations
from apo_bench.correction.solvers.compact import CompactEquations, build_compact_equations, linearise_by
from apo_bench.correction.solvers.gauss_newton import NearestPoses, find_nearest_poses
from apo_bench.correction.solvers.posterior import compute_jacobian_rank
from apo_bench.geometry import Array, pose
from tests import scenes

pytestmark = pytest.mark.numeric

RANKS = {"bridge": 11, "stick_on_castles": 13, "stick_in_tower": 13, "pockets": 28}
LEVELS = [(2.0, 1.0), (10.0, 8.0)]


def scales(n: int, mm: float, deg: float) -> Array:
    """L of independent noise along and about every axis, (n, 6, 6)."""
    return np.tile(np.diag(np.repeat([mm * 1e-3, np.radians(deg)], 3)), (n, 1, 1))


def crooked(n: int, rng: np.random.Generator, mm: float = 2.0, deg: float = 1.0) -> Array:
    """L of noise that is correlated and several times larger one way than another, different for every part."""
    turn = np.linalg.qr(rng.standard_normal((n, 6, 6)))[0]
    return scales(n, mm, deg) @ turn @ (np.exp(rng.uniform(-1.5, 1.5, (n, 6)))[:, :, None] * np.eye(6))


def system_of(scene: scenes.Scene, goals: Array) -> CompactEquations:
    return build_compact_equations(build_contact_equations(scene.assembly, scene.start, goals), len(goals))


def twisted(goals: Array, L: Array, rng: np.random.Generator) -> Array:
    return np.asarray(goals @ pose.exp((L @ rng.standard_normal((len(goals), 6, 1)))[..., 0]))


def correction(seen: Array, goals: Array, L: Array) -> Array:
    """z of a change of goals, (6 n,)."""
    return np.asarray(np.linalg.solve(L, pose.log(pose.inverse(seen) @ goals)[..., None]).reshape(-1))


def jacobian(system: CompactEquations, found: NearestPoses) -> Array:
    """The derivative of e by z where the solver ended, (3 c, 6 n)."""
    return linearise_by(system, found.poses, found.B)[1].T


def drift(J: Array, z: Array, directions: int) -> float:
    """Length of what z has along directions that the contacts leave free."""
    return float(np.linalg.norm(np.linalg.svd(J)[2][directions:] @ z))


@pytest.mark.parametrize("name", RANKS)
@pytest.mark.parametrize("level", LEVELS)
def test_on_the_manifold_and_nearest(name: str, level: tuple[float, float]) -> None:
    """Of noise that is alike for every part, and of noise that is correlated."""
    scene = scenes.ALL[name]()
    n = len(scene.nominal_poses)
    for seed in range(6):
        rng = np.random.default_rng(seed)
        L = crooked(n, rng) if seed % 2 else scales(n, *level)
        seen = twisted(scene.nominal_poses, L, rng)
        system = system_of(scene, seen)
        found = find_nearest_poses(system, seen, L)
        assert found.at_rest
        assert found.finite
        assert np.abs(build_contact_equations(scene.assembly, scene.start, seen).residual(found.poses)).max() <= 1e-12
        J = jacobian(system, found)
        assert compute_jacobian_rank(J.T) == compute_jacobian_rank(found.Jt) == RANKS[name]
        assert drift(J, found.z, RANKS[name]) <= 1e-6
        assert_allclose(found.poses, seen @ pose.exp((L @ found.z.reshape(n, 6, 1))[..., 0]), rtol=0, atol=1e-14)
        truth = correction(seen, scene.nominal_poses, L)
        assert found.z @ found.z <= truth @ truth + 1e-9


@pytest.mark.parametrize("name", ["stick_on_castles", "pockets"])
def test_soft_contacts_balance_the_noise(name: str) -> None:
    """The gradient of |z|^2 + |e / soft|^2 vanishes; contacts that are demanded hold."""
    scene = scenes.ALL[name]()
    rng = np.random.default_rng(4)
    n = len(scene.nominal_poses)
    for demands_of in (0.0, 0.5):
        L = crooked(n, rng)
        seen = twisted(scene.nominal_poses, L, rng)
        system = system_of(scene, seen)
        hard = np.repeat(rng.random(len(system)) < demands_of, 3)
        soft_m = np.where(hard, 0.0, rng.uniform(0.1e-3, 2e-3, len(hard)))
        found = find_nearest_poses(system, seen, L, soft_m)
        assert found.at_rest
        assert np.abs(found.e[hard]).max(initial=0.0) <= 1e-11
        assert np.abs(found.e[~hard]).max() > 1e-6
        J = jacobian(system, found)
        gradient = found.z + J[~hard].T @ (found.e[~hard] / soft_m[~hard] ** 2)
        free = np.linalg.svd(J[hard])[2][compute_jacobian_rank(J[hard].T) :] if hard.any() else np.eye(6 * n)
        assert np.linalg.norm(free @ gradient) <= 1e-4 * np.linalg.norm(found.z)
