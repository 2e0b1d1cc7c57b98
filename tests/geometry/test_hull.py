"""Convex pieces: as boxes where they are boxes, as their formulas say where they are round."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from apo_bench.geometry import (
    Box,
    Hull,
    PosedPieces,
    RoundFace,
    Solid,
    find_separating_axes,
    measure_intrusion_depths,
    shrink_pieces,
)
from tests.geometry.overlaps import overlap_intervals


def posed(rng: np.random.Generator, reach: float = 0.05) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    T[:3, 3] = rng.uniform(-reach, reach, 3)
    return T


def solid(*pieces: Box | Hull, **rounds: RoundFace) -> Solid:
    return Solid("part", {}, pieces, np.zeros(3), 1.0, rounds)


def as_hull(box: Box) -> Hull:
    return Hull(box.name, box.corners)


@pytest.mark.parametrize("seed", range(5))
def test_a_box_as_a_hull_is_as_deep_in_another_one_as_the_box(seed: int):
    rng = np.random.default_rng(seed)
    a, b = (Box(name, rng.uniform(-0.02, 0.02, 3), rng.uniform(0.005, 0.03, 3)) for name in "ab")
    T_a = posed(rng)
    T_b = posed(rng)
    wanted = measure_intrusion_depths((a,), T_a[:3, :3], T_a[None, :3, 3], (b,), T_b)
    found = measure_intrusion_depths((as_hull(a),), T_a[:3, :3], T_a[None, :3, 3], (b,), T_b)
    if wanted[0] > 0.0:
        assert found == pytest.approx(wanted, abs=1e-12)
    assert (found > 0.0) == (wanted > 0.0)
    way = rng.standard_normal(3)
    way /= np.linalg.norm(way)
    spans = overlap_intervals(PosedPieces((a,), T_a), way, PosedPieces((b,), T_b))
    same = overlap_intervals(PosedPieces((as_hull(a),), T_a), way, PosedPieces((as_hull(b),), T_b))
    assert same == pytest.approx(spans, abs=1e-9)


def wedges(radius: float, n: int) -> tuple[Hull, ...]:
    """A square plate of 40 x 40 x 20 mm with a round hole, as prisms."""
    k = radius / np.cos(np.pi / n)
    found = []
    for i in range(n):
        turn = 2.0 * np.pi * (i + np.array([-0.5, 0.5])) / n
        ring = np.column_stack([np.cos(turn), np.sin(turn)])
        flat = np.concatenate([k * ring, 0.02 * ring])
        found.append(Hull(f"w{i}", np.concatenate([np.column_stack([flat, np.full(4, z)]) for z in (0.0, 0.02)])))
    return tuple(found)


def bore(radius: float, fit: bool) -> RoundFace:
    return RoundFace("bore", np.zeros(3), np.array([0.0, 0.0, 1.0]), (0.0, 0.02), (radius, radius), True, fit)


def test_a_hole_that_fits_gets_wider_by_the_clearance():
    clearance_mm = 0.25
    plate = solid(*wedges(0.005, 70), bore=bore(0.005, fit=True))
    made = shrink_pieces(plate, 1e-3 * clearance_mm)
    inner = [np.linalg.norm(p.corners[:, :2], axis=1).min() * np.cos(np.pi / 70) for p in made]
    assert inner == pytest.approx(np.full(70, 0.005 + 1e-3 * clearance_mm), abs=1e-9)
    outer = [np.linalg.norm(p.corners[:, :2], axis=1).max() for p in made]
    assert outer == pytest.approx(np.full(70, 0.02), abs=1e-9)
    plain = solid(*wedges(0.005, 70), bore=bore(0.005, fit=False))
    assert shrink_pieces(plain, 1e-3 * clearance_mm) is plain.pieces


@pytest.mark.parametrize("seed", range(2))
def test_pairs_that_are_not_looked_at_change_no_depth(seed: int):
    """Against every pair of pieces across every side and edge."""
    rng = np.random.default_rng(seed)
    a, b = (
        tuple(Hull(f"{i}", rng.uniform(-0.01, 0.01, (8, 3)) + rng.uniform(-0.02, 0.02, 3)) for i in range(6))
        for _ in range(2)
    )
    T_a = posed(rng, 0.02)
    T_b = posed(rng, 0.02)
    at = T_a[:3, 3] + rng.uniform(-0.05, 0.05, (5, 3))
    found = measure_intrusion_depths(a, T_a[:3, :3], at, b, T_b)
    for place, depth in zip(at, found, strict=True):
        every = []
        for p, q in product(a, b):
            axes = find_separating_axes(p, T_a[:3, :3], q, T_b[:3, :3])
            low_p = (p.corners @ T_a[:3, :3].T + place) @ axes.T
            low_q = (q.corners @ T_b[:3, :3].T + T_b[:3, 3]) @ axes.T
            outs = np.minimum(low_p.max(0) - low_q.min(0), low_q.max(0) - low_p.min(0))
            every.append(outs.min())
        if max(every) > 0.0:
            assert depth == pytest.approx(max(every), abs=1e-12)
        assert (depth > 0.0) == (max(every) > 0.0)
