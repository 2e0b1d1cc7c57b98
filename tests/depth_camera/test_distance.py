"""Distances from convex pieces and where rays strike them, held against boxes, formulas and an optimiser."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial import ConvexHull

from apo_bench.depth_camera.distance import shape_of, signed_distance, strike_distances
from apo_bench.geometry import Box, Cylinder, Hull, cylinder_hull, pose

T = pose.at((0.03, -0.02, 0.05), (20.0, -40.0, 70.0))
BOXES = (Box("a", np.array([0.01, 0.0, 0.0]), np.array([0.03, 0.01, 0.02])), Box("b", np.zeros(3), np.full(3, 0.012)))


def as_hull(box: Box) -> Hull:
    return Hull(box.name, box.corners)


def rays(rng: np.random.Generator, n: int) -> np.ndarray:
    way = rng.standard_normal((n, 3))
    return np.asarray(way / np.linalg.norm(way, axis=1)[:, None])


def test_boxes_as_hulls_are_as_far_as_boxes_and_struck_where_these_are():
    rng = np.random.default_rng(0)
    plain = shape_of(BOXES, T)
    hulls = shape_of([as_hull(BOXES[0]), BOXES[1]], T)
    points = pose.apply(T, rng.uniform(-0.06, 0.06, (2000, 3)))
    d, gradient = signed_distance(plain, points)
    found, same = signed_distance(hulls, points)
    assert found == pytest.approx(d, abs=1e-12)
    outside = d > 1e-6
    assert same[outside] == pytest.approx(gradient[outside], abs=1e-9)
    eye = pose.apply(T, np.array([0.2, 0.1, -0.15]))
    ways = pose.apply(T, rng.uniform(-0.04, 0.04, (2000, 3))) - eye
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    far, which = strike_distances(plain, eye, ways)
    again, piece = strike_distances(hulls, eye, ways)
    assert np.isfinite(far).sum() > 200
    assert again == pytest.approx(far, abs=1e-12)
    assert (piece == which).all()


@pytest.mark.parametrize("seed", range(4))
def test_distance_from_a_convex_piece_is_that_of_an_optimiser(seed: int):
    rng = np.random.default_rng(seed)
    cloud = rng.uniform(-0.03, 0.03, (12, 3))
    hull = Hull("h", cloud[ConvexHull(cloud).vertices])
    n = hull.planes[:, :3]
    d = hull.planes[:, 3]
    points = rng.uniform(-0.06, 0.06, (40, 3))
    found, gradient = signed_distance(shape_of([hull]), points)
    for p, distance, way in zip(points, found, gradient, strict=True):
        assert np.linalg.norm(way) == pytest.approx(1.0)
        if distance <= 0.0:
            assert (n @ p - d).max() == pytest.approx(distance, abs=1e-12)
            continue
        best = minimize(
            lambda x, p=p: 1e4 * float((x - p) @ (x - p)),
            hull.corners.mean(axis=0),
            jac=lambda x, p=p: 2e4 * (x - p),
            constraints={"type": "ineq", "fun": lambda x: 1e2 * (d - n @ x), "jac": lambda x: -1e2 * n},
            options={"ftol": 1e-14, "maxiter": 200},
        )
        assert distance == pytest.approx(float(np.linalg.norm(best.x - p)), abs=1e-6)
        assert (n @ (p - distance * way) - d).max() < 1e-9


def test_a_shaft_is_as_far_as_its_formula_and_struck_within_its_sagitta():
    rng = np.random.default_rng(1)
    axis = rays(rng, 1)[0]
    shape = shape_of([cylinder_hull("c", Cylinder(np.array([0.01, 0.02, 0.0]), axis, 0.008, 0.03))])
    points = rng.uniform(-0.06, 0.06, (2000, 3))
    off = points - [0.01, 0.02, 0.0]
    z = np.abs(off @ axis) - 0.03
    r = np.sqrt(np.maximum((off * off).sum(axis=1) - (off @ axis) ** 2, 0.0)) - 0.008
    wanted = np.hypot(np.maximum(r, 0.0), np.maximum(z, 0.0)) + np.minimum(np.maximum(r, z), 0.0)
    d, gradient = signed_distance(shape, points)
    assert d == pytest.approx(wanted, abs=1e-12)
    step = 1e-7
    slope = (signed_distance(shape, points + step * gradient)[0] - d) / step
    assert np.median(np.abs(slope - 1.0)) < 1e-6
    eye = np.array([0.2, 0.2, 0.1])
    ways = rng.uniform(-0.03, 0.03, (500, 3)) - eye
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    far, _ = strike_distances(shape, eye, ways)
    struck = np.isfinite(far)
    assert struck.sum() > 50
    assert np.abs(signed_distance(shape, eye + far[struck, None] * ways[struck])[0]).max() < 6e-6
