"""Penetration of random convex pieces against the Minkowski difference of their corners, which knows no axes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from apo_bench.geometry import Hull, measure_intrusion_depths


def random_hull(rng: np.random.Generator) -> Hull:
    points = rng.normal(size=(int(rng.integers(5, 24)), 3)) * rng.uniform(0.003, 0.02, 3)
    return Hull("piece", points[ConvexHull(points).vertices])


def moved(rng: np.random.Generator, reach: float) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    T[:3, 3] = rng.uniform(-reach, reach, 3)
    return T


def depth(a: np.ndarray, b: np.ndarray) -> float:
    """How far a must move at least to be free of b: the least distance of the origin from the border of b - a, [m]."""
    found = ConvexHull((b[:, None] - a[None]).reshape(-1, 3)).equations
    return float(max(0.0, -found[:, 3].max()))


def overlap(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether a point is a mean of the corners of a, and of those of b."""
    A = np.zeros((5, len(a) + len(b)))
    A[:3] = np.concatenate([a, -b]).T
    A[3, : len(a)] = A[4, len(a) :] = 1.0
    return bool(linprog(np.zeros(A.shape[1]), A_eq=A, b_eq=[0.0, 0.0, 0.0, 1.0, 1.0]).success)


@pytest.mark.parametrize("seed", range(30))
def test_random_pieces_are_as_deep_as_their_difference_says(seed: int):
    rng = np.random.default_rng(seed)
    a = random_hull(rng)
    b = random_hull(rng)
    T_a = moved(rng, 0.02)
    T_b = moved(rng, 0.005)
    corners = [hull.corners @ T[:3, :3].T + T[:3, 3] for hull, T in ((a, T_a), (b, T_b))]
    wanted = depth(*corners)
    found = float(measure_intrusion_depths((a,), T_a[:3, :3], T_a[None, :3, 3], (b,), T_b)[0])
    assert max(0.0, found) == pytest.approx(wanted, abs=1e-9)
    if abs(found) > 1e-7:
        assert (found > 0.0) == overlap(*corners)
