"""The contact equations: zero at the truth, and the Jacobian against central differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from apo_bench import Assembly
from apo_bench.assembly import Contact, Equations, Operation, PartFace, build_contact_equations, compute_placements
from apo_bench.correction.solvers.newton import LENGTH_M, SINGULAR_CUT_OFF, compute_least_step
from apo_bench.geometry import Array, pose
from apo_bench.geometry.covering import compute_overlap
from tests import scenes

pytestmark = pytest.mark.numeric

PARTS = ("a", "b", "c", "s", "idle")


def random_scene(seed: int) -> scenes.Scene:
    """Cuboids, operations that carry one another, contacts of any faces, start poses and goals anywhere."""
    rng = np.random.default_rng(seed)
    solids = [scenes.cuboid(part, rng.uniform(10, 60, 3)) for part in PARTS]
    operations = []
    for _ in range(7):
        main, *others = (str(part) for part in rng.permutation(PARTS[:4]))
        carries = tuple(others[: rng.integers(0, 3)])
        moved = (main, *carries)
        rest = [part for part in PARTS if part not in moved]
        contacts = tuple(
            Contact(PartFace(str(rng.choice(moved)), face), PartFace(str(rng.choice(rest)), other))
            for face, other in rng.choice(["px", "ny", "pz", "nz"], (rng.integers(0, 3), 2))
        )
        operations.append(Operation(main, contacts, carries))
    start = {part: pose.exp(rng.standard_normal(6) * 0.5) for part in PARTS}
    assembly = Assembly({solid.name: solid for solid in solids}, tuple(operations), frozenset({"idle"}))
    return scenes.Scene(assembly, start, pose.exp(rng.standard_normal((7, 6)) * 0.5))


def differences(scene: scenes.Scene, by: float = 1e-6) -> tuple[Array, Array]:
    """The analytic Jacobian and the one of central differences, by body twists of every goal."""
    system = build_contact_equations(scene.assembly, scene.start, scene.nominal_poses)
    _, J = system.linearise(scene.nominal_poses)
    numeric = np.zeros_like(J)
    for k in range(len(scene.nominal_poses)):
        for i in range(6):
            side = []
            for sign in (1.0, -1.0):
                goals = scene.nominal_poses.copy()
                goals[k] = goals[k] @ pose.exp(sign * by * np.eye(6)[i])
                side.append(system.residual(goals))
            numeric[:, 6 * k + i] = (side[0] - side[1]) / (2 * by)
    return J, numeric


@given(st.integers(0, 10**6))
@settings(max_examples=25, deadline=None)
def test_jacobian_of_random_assemblies(seed: int) -> None:
    J, numeric = differences(random_scene(seed))
    assert np.abs(J - numeric).max(initial=0.0) <= 1e-6 * max(1.0, np.abs(J).max(initial=0.0))


@given(st.integers(0, 10**6))
@settings(max_examples=20, deadline=None)
def test_equations_are_distances_of_posed_vertices_to_posed_planes(seed: int) -> None:
    scene = random_scene(seed)
    e = build_contact_equations(scene.assembly, scene.start, scene.nominal_poses).residual(scene.nominal_poses)
    history = compute_placements(scene.assembly, scene.start, scene.nominal_poses)
    row = 0
    for contact, made, _ in scene.assembly.relations():
        m, b = contact
        T = history[made][m.part]
        n = scene.assembly.face(m).plane
        face = scene.assembly.face(b)
        on = history[made][b.part]
        smaller_first = scenes_area(face) <= scenes_area(scene.assembly.face(m)) * (1 + 1e-9)
        corners = pose.apply(on, face.outline) if smaller_first else pose.apply(T, scene.assembly.face(m).outline)
        if not smaller_first:
            normal = on[:3, :3] @ face.normal
            corners = corners - np.outer((corners - pose.apply(on, face.outline)[0]) @ normal, normal)
        expected = pose.apply(pose.inverse(T), corners) @ n[:3] + n[3]
        assert_allclose(e[row : row + 4], expected, atol=1e-12)
        row += 4
    assert row == len(e)


def scenes_area(face) -> float:
    return compute_overlap(face, np.eye(4), face, np.eye(4)).area


@given(st.integers(0, 10**6))
@settings(max_examples=10, deadline=None)
def test_the_world_frame_does_not_matter(seed: int) -> None:
    scene = random_scene(seed)
    moved = scenes.turned(scene, pose.exp(np.random.default_rng(seed).standard_normal(6)))
    e, J = build_contact_equations(scene.assembly, scene.start, scene.nominal_poses).linearise(scene.nominal_poses)
    e_moved, J_moved = build_contact_equations(moved.assembly, moved.start, moved.nominal_poses).linearise(
        moved.nominal_poses
    )
    assert_allclose(e_moved, e, atol=1e-12)
    assert_allclose(J_moved, J, atol=1e-12)


def with_free(system: Equations, free: set[int] | None) -> Equations:
    return system if free is None else system.among(system.contacts_with(free))


@pytest.mark.parametrize(
    ("name", "free", "rank"),
    [
        ("stick_on_castles", None, 13),
        ("bridge", None, 11),
        ("pockets", (0, 1, 2, 4, 5), 25),
        ("stick_in_tower", None, 13),
    ],
)
def test_ranks_at_the_truth(name: str, free: tuple[int, ...] | None, rank: int) -> None:
    scene = scenes.ALL[name]()
    columns = range(len(scene.nominal_poses)) if free is None else free
    e, J = with_free(build_contact_equations(scene.assembly, scene.start, scene.nominal_poses), free).linearise(
        scene.nominal_poses
    )
    chosen = J.reshape(len(e), -1, 6)[:, list(columns)].reshape(len(e), -1)
    scaled = chosen / np.tile([1.0, 1.0, 1.0, LENGTH_M, LENGTH_M, LENGTH_M], len(columns))
    assert [compute_least_step(scaled, e, cut)[1] for cut in (SINGULAR_CUT_OFF, 1e-7)] == [rank, rank]


@given(st.integers(0, 10**6))
@settings(max_examples=30, deadline=None)
def test_least_step_is_the_pseudo_inverse(seed: int) -> None:
    rng = np.random.default_rng(seed)
    J = rng.standard_normal((8, 3)) @ rng.standard_normal((3, 6))
    e = rng.standard_normal(8)
    step, rank = compute_least_step(J, e, 1e-9)
    assert rank == 3
    assert_allclose(step, -np.linalg.pinv(J, rcond=1e-9) @ e, atol=1e-9)
