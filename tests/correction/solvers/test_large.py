"""Many operations: sparse matrices give what dense ones give, and the rank is right where only they are possible."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import csr_array

from apo_bench import Assembly, correct
from apo_bench.assembly import Operation
from apo_bench.correction.solvers import posterior, sparse
from apo_bench.correction.solvers.compact import CompactEquations
from apo_bench.correction.solvers.gauss_newton import NearestPoses, find_nearest_poses, solve_batch
from apo_bench.geometry import Array
from benchmarks.corrector_problems import problem
from tests import scenes
from tests.correction.solvers.test_manifold import crooked, scales, system_of, twisted

BLOCK = scenes.block()


def hub(n: int) -> scenes.Scene:
    """One plate, b0, that carries blocks, b1, b2 and so on."""
    solids = {"table": scenes.table(), "b0": scenes.cuboid("plate", (600, 500, 10))}
    operations = [Operation("b0", scenes.touch("b0", "table", "nz-top"))]
    goals = [scenes.mm(0, 0, 10)]
    for k in range(1, n):
        solids[f"b{k}"] = BLOCK
        operations.append(Operation(f"b{k}", scenes.touch(f"b{k}", "b0", "nz-pz")))
        goals.append(scenes.mm(k % 20, k // 20, 45))
    assembly = Assembly(solids, tuple(operations), frozenset({"table"}))
    return scenes.Scene(assembly, {part: np.eye(4) for part in solids}, np.array(goals))


def fence(n: int) -> scenes.Scene:
    """Blocks side by side, each against the one before."""
    operations = [Operation("b0", scenes.touch("b0", "table", "nz-top"))]
    for k in range(1, n):
        touching = scenes.touch(f"b{k}", "table", "nz-top") + scenes.touch(f"b{k}", f"b{k - 1}", "nx-px")
        operations.append(Operation(f"b{k}", touching))
    parts = [scenes.table(), *(scenes.block(f"b{k}") for k in range(n))]
    return scenes.scene(parts, operations, [scenes.mm(50 * k, 0, 25) for k in range(n)])


def of_problem(name: str) -> scenes.Scene:
    given = problem(name)
    return scenes.Scene(given.assembly, given.start, given.poses)


SMALL: dict[str, tuple[Callable[[], scenes.Scene], int]] = {
    "chain3": (lambda: of_problem("chain3"), 23),
    "grid3": (lambda: of_problem("grid3"), 107),
    "hub": (lambda: hub(12), 36),
    "fence": (lambda: fence(12), 3 + 11 * 5),
    "pockets": (scenes.pockets, 28),
}
"""Scenes, and the rank of their contacts by hand (chains 10 K - 7, grids 16 G^2 - 12 G - 1)."""


def drawn(name: str, seed: int = 0) -> tuple[CompactEquations, Array, Array]:
    scene = SMALL[name][0]()
    rng = np.random.default_rng(seed)
    L = crooked(len(scene.nominal_poses), rng)
    seen = twisted(scene.nominal_poses, L, rng)
    return system_of(scene, seen), seen, L


@pytest.fixture(params=["banded", "together", "crowded"])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Each way to solve for z, whatever the graph."""
    if request.param == "crowded":
        monkeypatch.setattr(sparse, "CROWDED", 0)
    else:
        monkeypatch.setattr(sparse, "WIDE", {"banded": 10**9, "together": 0}[request.param])
    return str(request.param)


def nearest_goals_sparse(system: CompactEquations, seen: Array, L: Array, soft_m: Array | None = None) -> NearestPoses:
    return solve_batch(system, seen[None], L[None], soft_m, sparse=True).at(0)


@pytest.mark.parametrize("name", SMALL)
def test_sparse_is_dense(name: str, way: str) -> None:
    system, seen, L = drawn(name)
    large = nearest_goals_sparse(system, seen, L)
    small = find_nearest_poses(system, seen[None], L)
    assert large.at_rest
    assert small.at_rest.all()
    assert_allclose(large.poses, small.poses[0], rtol=0, atol=1e-9)
    assert_allclose(large.z, small.z[0], rtol=0, atol=1e-6)
    assert_allclose(large.Jt.toarray(), small.Jt[0], rtol=0, atol=1e-8)
    assert_allclose(large.B, small.B[0], rtol=0, atol=1e-9)
    assert np.abs(large.e).max() <= 1e-12


@pytest.mark.parametrize("name", SMALL)
@pytest.mark.parametrize("few", [0, 10**9])
def test_rank_by_inertia_is_rank_by_singular_values(name: str, few: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sparse, "FEW", few)
    for seed in range(2):
        system, seen, L = drawn(name, seed)
        Jt = find_nearest_poses(system, seen[None], L).Jt[0]
        assert sparse.sparse_rank(csr_array(Jt)) == posterior.compute_jacobian_rank(Jt) == SMALL[name][1]


@pytest.mark.parametrize("name", SMALL)
def test_what_a_sparse_matrix_leaves_free_is_what_its_singular_vectors_say(name: str) -> None:
    """Both are off by rounding over the smallest singular value: the largest difference seen was 2e-12."""
    system, seen, L = drawn(name)
    Jt = find_nearest_poses(system, seen[None], L).Jt[0]
    free = sparse.free_basis(csr_array(Jt), *posterior.UNCLEAR)
    assert free is not None
    known = posterior.compute_freedom(Jt)
    assert known is not None
    assert_allclose(free.T @ free, np.eye(len(Jt) - SMALL[name][1]), rtol=0, atol=1e-12)
    assert_allclose(free @ free.T, known.free @ known.free.T, rtol=0, atol=1e-9)


def test_the_corrector_takes_many_operations_whole() -> None:
    """What would be a dense matrix is not stated; everything else is."""
    scene = fence(400)
    goals = twisted(scene.nominal_poses, scales(400, 1.0, 1.0), np.random.default_rng(1))
    made = correct(scenes.seen(scene, goals), "contact")
    assert made.ok, made.sentence
    assert made.rank == 3 + 399 * 5
    assert made.test is not None
    assert made.test.freedom == made.rank
    assert 0.0 < made.test.p_value < 1.0
    assert made.covariance is None
