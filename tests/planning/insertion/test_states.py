"""The ten contact states, against their definition: corners of the cone one by one."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from apo_bench.geometry import Array
from apo_bench.planning.insertion.contact_states import (
    STATE_LETTERS,
    ContactState,
    classify_motions,
    classify_with_rotations,
    compute_null_space,
    compute_row_rank,
)

X, Y, Z = np.eye(3)
TEN = {
    "S": [],
    "A": [Z],
    "B": [Y, -Y],
    "C": [Z, X],
    "D": [Z, Y, -Y],
    "E": [Y, -Y, Z, -Z],
    "F": [X, Y, Z],
    "G": [Z, X, Y, -Y],
    "H": [X, -X, Y, -Y, Z],
    "I": [X, -X, Y, -Y, Z, -Z],
}


def rows(normals: list[Array]) -> Array:
    return np.array(normals).reshape(-1, 3)


@pytest.mark.parametrize("letter", TEN)
def test_a_state_does_not_depend_on_the_frame_the_order_or_on_repetition(letter: str) -> None:
    rng = np.random.default_rng(4)
    state = classify_motions(rows(TEN[letter])).state
    assert (state.letter, sum(state), STATE_LETTERS[tuple(state)]) == (letter, 3, letter)
    for R in Rotation.random(10, random_state=rng).as_matrix():
        normals = rows(TEN[letter]) @ R.T
        again = np.concatenate([normals, normals])[rng.permutation(2 * len(normals))]
        assert classify_motions(again).state == state


def random_contacts(rng: np.random.Generator) -> Array:
    """Some faces of a random polyhedron: any normals, parallel walls, prisms, all turned at random."""
    kind = rng.integers(5)
    n = rng.standard_normal((rng.integers(1, 7), 3))
    if kind == 1:
        n = np.concatenate([n[:1], -n[:1], n[1 : rng.integers(1, 4)]])
    elif kind == 2:
        n[:, 2] = 0.0
        n = np.concatenate([n, Z[None][: rng.integers(2)]])
    elif kind == 3:
        n = np.concatenate([n[:2], -n[:2], n[2 : 2 + rng.integers(2)]])
    elif kind == 4:
        n = np.concatenate([n[:3], -n[:3]])
    return n / np.linalg.norm(n, axis=1)[:, None] @ Rotation.random(random_state=rng).as_matrix().T


def corners_of_cone(normals: Array) -> Array:
    """Vectors that span the cone exactly: its linear space both ways, and where two faces of the rest meet, (k, 3)."""
    lines = compute_null_space(normals)
    edges = [np.cross(a, b) for a, b in combinations([*normals, *lines], 2)]
    edges += [a - sum(((a @ line) * line for line in lines), np.zeros(3)) for a in normals]
    found = [sign * edge / np.linalg.norm(edge) for edge in edges if np.linalg.norm(edge) > 1e-7 for sign in (-1, 1)]
    candidates = np.array([*found, *lines, *-lines]).reshape(-1, 3)
    return candidates[(candidates @ normals.T >= -1e-9).all(axis=1)]


def test_the_programme_agrees_with_the_corners_of_the_cone() -> None:
    """m, d and c by their definitions: dimensions of the linear space and of the span of the whole cone."""
    rng = np.random.default_rng(3)
    for _ in range(80):
        normals = random_contacts(rng)
        found = classify_motions(normals)
        spanned = compute_row_rank(corners_of_cone(normals))
        m = 3 - compute_row_rank(normals)
        assert found.state == ContactState(m, spanned - m, 3 - spanned)
        assert found.admits(found.direction, 1e-9)
        assert (normals[found.detachable] @ found.direction > 0.0).all()
        assert np.abs(normals[~found.detachable] @ found.direction).max(initial=0.0) < 1e-6


def rectangle(normal: Array, at: Array, u: Array, v: Array) -> tuple[Array, Array]:
    """The corners of a face about a point, and the normal at each."""
    return np.array([at + a * u + b * v for a in (-1, 1) for b in (-1, 1)]), np.tile(normal, (4, 1))


FLOOR = rectangle(Z, -0.01 * Z, 0.03 * X, 0.01 * Y)
LEFT, RIGHT = (rectangle(s * Y, -s * 0.01 * Y, 0.03 * X, 0.005 * Z) for s in (1, -1))
ENDS = tuple(rectangle(s * X, -s * 0.03 * X, 0.01 * Y, 0.01 * Z) for s in (1, -1))


@pytest.mark.parametrize(
    ("faces", "everything", "rotation"),
    [
        ((FLOOR,), (3, 3, 0), (1, 2, 0)),
        ((FLOOR, LEFT, RIGHT), (1, 2, 3), (0, 1, 2)),
        ((FLOOR, LEFT, RIGHT, *ENDS), (0, 1, 5), (0, 0, 3)),
    ],
)
def test_states_with_rotation(faces: tuple, everything: tuple, rotation: tuple) -> None:
    points = np.concatenate([face[0] for face in faces])
    normals = np.concatenate([face[1] for face in faces])
    rng = np.random.default_rng(6)
    for R in Rotation.random(5, random_state=rng).as_matrix():
        found = classify_with_rotations(points @ R.T + rng.standard_normal(3), normals @ R.T)
        assert (found.all, found.rotation) == (everything, rotation)
        assert sum(found.all) == 6
        assert sum(found.rotation) == 3
