"""Boxes that are swept along a line: against samples of the way, and cases by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from apo_bench.geometry import (
    Array,
    Box,
    Hull,
    PosedPieces,
    Solid,
    compute_exit_distance,
    is_path_free,
    measure_intrusion_depths,
    pose,
)
from tests import scenes
from tests.geometry.overlaps import overlap_intervals

X, Y, Z = np.eye(3)


def boxes(rng: np.random.Generator) -> PosedPieces:
    """One to three boxes of some centimetres, turned and shifted at random."""
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=rng).as_matrix() if rng.integers(3) else np.eye(3)
    T[:3, 3] = rng.uniform(-0.1, 0.1, 3)
    many = [Box(f"b{i}", rng.uniform(-0.03, 0.03, 3), rng.uniform(0.005, 0.03, 3)) for i in range(rng.integers(1, 4))]
    return PosedPieces(tuple(many), T)


def test_swept_boxes_meet_where_they_do_at_every_place_of_the_way() -> None:
    rng = np.random.default_rng(1)
    met = 0
    for _ in range(100):
        a = boxes(rng)
        b = boxes(rng)
        slack = rng.choice([5e-5, -5e-5])
        way = rng.standard_normal(3) if rng.integers(2) else np.eye(3)[rng.integers(3)]
        way = way / np.linalg.norm(way)
        s = np.linspace(-0.3, 0.3, 301)
        deep = measure_intrusion_depths(a.pieces, a.T[:3, :3], a.T[:3, 3] + np.outer(s, way), b.pieces, b.T) - slack
        spans = overlap_intervals(a, way, b, slack)
        inside = ((s[:, None] > spans[:, 0]) & (s[:, None] < spans[:, 1])).any(axis=1)
        clear = np.abs(deep) > 1e-9
        np.testing.assert_array_equal(inside[clear], deep[clear] > 0.0)
        met += bool(inside.any())
    assert met > 15


def posed(solid: Solid, T: Array) -> PosedPieces:
    return PosedPieces(solid.pieces, T)


def test_touching_is_not_meeting_and_ends_where_the_parts_do() -> None:
    stick = posed(scenes.stick(), scenes.mm(0, 0, 25))
    cube = posed(scenes.cube(), scenes.mm(0, 0, 25))
    assert is_path_free([stick], X, 0.5, [cube])
    assert is_path_free([stick], -X, 0.5, [cube])
    assert not is_path_free([stick], Z, 0.05, [cube])
    assert not is_path_free([stick], (X + 0.01 * Y) / np.linalg.norm(X + 0.01 * Y), 0.5, [cube])
    assert compute_exit_distance([stick], X, [cube]) == pytest.approx(0.135, abs=1e-9)
    assert compute_exit_distance([stick], X, []) == 0.0
    second = posed(scenes.cube(), scenes.mm(60, 0, 25))
    assert compute_exit_distance([stick], X, [cube, second]) == pytest.approx(0.195, abs=1e-9)
    assert compute_exit_distance([stick], -X, [cube, second]) == pytest.approx(0.135, abs=1e-9)
    beyond = posed(scenes.block(), scenes.mm(300, 0, 25))
    assert is_path_free([stick], X, 0.1649, [cube, beyond])
    assert not is_path_free([stick], X, 0.1652, [cube, beyond])


def test_the_end_of_the_overlap_is_the_same_for_all_kinds_of_pieces() -> None:
    """Looked for among boxes around pieces first; held against the intervals of all pairs, one chained to the next."""
    rng = np.random.default_rng(5)
    left = 0
    for _ in range(40):
        a = boxes(rng)
        b = boxes(rng)
        c = boxes(rng)
        near = [PosedPieces(of.pieces, pose.at(rng.uniform(-0.02, 0.02, 3) - of.T[:3, 3]) @ of.T) for of in (b, c)]
        way = rng.standard_normal(3)
        way = way / np.linalg.norm(way)
        moving = PosedPieces(a.pieces, np.eye(4))
        hulls = [PosedPieces(tuple(Hull(p.name, p.corners) for p in of.pieces), of.T) for of in (moving, *near)]
        spans = np.concatenate([overlap_intervals(moving, way, of, -5e-5) for of in near])
        at = 0.0
        while len(on := spans[(spans[:, 0] <= at) & (spans[:, 1] > at)]):
            at = float(on[:, 1].max())
        wanted = max(0.0, at - 5e-5)
        left += wanted > 0.0
        assert compute_exit_distance([moving], way, near) == pytest.approx(wanted, abs=1e-12)
        assert compute_exit_distance(hulls[:1], way, hulls[1:]) == pytest.approx(wanted, abs=1e-9)
        assert compute_exit_distance([moving], way, [near[0], hulls[2]]) == pytest.approx(wanted, abs=1e-9)
    assert left > 20
