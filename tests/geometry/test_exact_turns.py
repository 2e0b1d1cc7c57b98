"""Parts of any pieces: after which turns they are the same, also after any turn about an axis."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from apo_bench.geometry import (
    Face,
    Hull,
    Solid,
    find_nearest_equivalent_pose,
    find_revolution,
    find_symmetries,
    make_rotation_about_axis,
    pose,
)
from tests.round_contacts import MM, part, ring, tube, wall


def prism(corners: np.ndarray, height: float, at: np.ndarray | None = None, fit: tuple[str, ...] = ()) -> Solid:
    """An upright prism over a convex polygon, (n, 2), as one piece with its faces, moved to a pose."""
    n = len(corners)
    T = np.eye(4) if at is None else at
    rings = [np.column_stack([corners, np.full(n, z)]) for z in (-height / 2, height / 2)]
    loops = {"bottom": rings[0][::-1], "top": rings[1]}
    for i in range(n):
        j = (i + 1) % n
        loops[f"side{i}"] = np.array([rings[0][i], rings[0][j], rings[1][j], rings[1][i]])
    faces = {name: Face(name, pose.apply(T, loop), fit=name in fit) for name, loop in loops.items()}
    solid = Hull("prism", pose.apply(T, np.concatenate(rings)))
    return Solid("prism", faces, (solid,), pose.apply(T, np.zeros((1, 3)))[0], 1e-6)


def regular(n: int, radius: float = 10 * MM) -> np.ndarray:
    turns = 2 * np.pi * (np.arange(n) + 0.5) / n
    return radius * np.column_stack([np.cos(turns), np.sin(turns)])


def bush(*extra: Face, sides: int | None = None) -> Solid:
    """A bush of 20 mm with round ends and walls, bored 8 mm."""
    ends = (ring("bottom", 0.0, 10 * MM, up=False), ring("top", 20 * MM, 10 * MM, up=True))
    walls = (wall("bore", 0.0, 20 * MM, 4 * MM, True), wall("outside", 0.0, 20 * MM, 10 * MM, False))
    return part("bush", tube(10 * MM, 4 * MM, 0.0, 20 * MM, sides), (*ends, *extra), walls)


@pytest.mark.parametrize(
    ("corners", "height", "order"),
    [
        (regular(4), np.sqrt(2) * 10 * MM, 24), (regular(3), 10 * MM, 6),
        (np.array([[-3, -2], [4, -2], [1, 3]]) * MM, 6 * MM, 1),
    ],
)  # fmt: skip
def test_a_prism_has_the_turns_of_its_polygon(corners, height, order):
    """However it lies in its own frame; a triangle of three different sides has none."""
    rng = np.random.default_rng(len(corners))
    for at in (np.eye(4), pose.exp(rng.standard_normal(6) * [0.02, 0.02, 0.02, 1, 1, 1])):
        solid = prism(corners - corners.mean(axis=0), height, at)
        found = find_symmetries(solid)
        assert len(found) == order
        spots = solid.pieces[0].corners
        for g in found:
            apart = np.linalg.norm(pose.apply(g, spots)[:, None] - spots[None], axis=-1)
            assert apart.min(axis=1).max() < 1e-9


@pytest.mark.parametrize("seed", range(3))
def test_the_nearest_pose_that_looks_alike_is_the_nearest_of_many(seed):
    rng = np.random.default_rng(seed)
    solid = bush()
    T = np.eye(4)
    expected = np.eye(4)
    T[:3, :3], expected[:3, :3] = (Rotation.random(random_state=rng).as_matrix() for _ in range(2))
    axis = find_revolution(solid)
    found = find_nearest_equivalent_pose(solid, T, expected)
    every = [
        T @ g @ make_rotation_about_axis(axis.point, axis.axis, t)
        for g in find_symmetries(solid)
        for t in np.linspace(-np.pi, np.pi, 721)
    ]
    best = max(np.trace(expected[:3, :3].T @ one[:3, :3]) for one in every)
    assert np.trace(expected[:3, :3].T @ found[:3, :3]) >= best - 1e-9
    assert min(np.abs(found - one).max() for one in every) < 0.01
