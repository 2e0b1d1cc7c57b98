"""Overlap of faces: areas known by hand, and laws that hold for any pose."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench.geometry import Array, Face, pose
from apo_bench.geometry.covering import FacePair, compute_overlap, compute_overlaps, compute_shares

pytestmark = pytest.mark.numeric

EYE = np.eye(4)
OVER = pose.at((0, 0, 0), (180, 0, 0))
"""Turned over, so that the face looks down."""


def rectangle(x: float, y: float) -> Face:
    """A face of 2x by 2y [m] in the plane z = 0 that looks up."""
    return Face("r", np.array([(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)]))


def ring(outer: float, inner: float) -> Face:
    """A square with a square hole [m]."""
    return Face("ring", rectangle(outer, outer).outline, (rectangle(inner, inner).outline[::-1],))


def mm(*corners: tuple[float, float]) -> Array:
    return 1e-3 * np.array([(x, y, 0.0) for x, y in corners])


U_SHAPE = Face("u", mm((-30, -30), (30, -30), (30, 30), (10, 30), (10, 0), (-10, 0), (-10, 30), (-30, 30)))
"""60 x 60 mm, a slot 20 wide and 30 deep from above."""

lengths = st.floats(-0.05, 0.05)
turns = st.floats(-180, 180)
poses = st.builds(lambda p, a: pose.at(p, a), st.tuples(lengths, lengths, lengths), st.tuples(turns, turns, turns))
flat_poses = st.builds(lambda x, y, a: pose.at((x, y, 0), (0, 0, a)), lengths, lengths, turns)


@pytest.mark.parametrize(
    ("T", "why"),
    [
        (pose.at((0.06, 0, 0), (180, 0, 0)), "they only share an edge"),
        (pose.at((0.2, 0, 0), (180, 0, 0)), "they are far apart"),
        (pose.at((0, 0, 0), (90, 0, 0)), "the upper face is seen edge-on"),
    ],
)
def test_no_overlap(T: Array, why: str):
    found = compute_overlap(rectangle(0.03, 0.03), T, rectangle(0.03, 0.03), EYE)
    assert found.area == 0.0, why
    assert found.corners.shape == (0, 3)
    assert not found


@given(flat_poses, poses)
@settings(max_examples=30, deadline=None)
def test_moving_both_parts_together_moves_the_corners_and_keeps_the_area(T_face: Array, T: Array):
    face = U_SHAPE
    on = ring(0.04, 0.012)
    before = compute_overlap(face, T_face @ OVER, on, EYE)
    after = compute_overlap(face, T @ T_face @ OVER, on, T)
    assert after.area == pytest.approx(before.area, abs=1e-12)
    if before and len(before.corners) == len(after.corners):
        gaps = np.linalg.norm(pose.apply(T, before.corners)[:, None] - after.corners[None], axis=-1).min(axis=0)
        assert gaps.max() < 1e-7


@given(flat_poses)
@settings(max_examples=20, deadline=None)
def test_the_area_is_that_of_counted_points(T_face: Array):
    """An independent count: points of a fine grid that lie in both faces."""
    step = 1e-3
    x, y = (g.ravel() for g in np.meshgrid(*[np.arange(-0.0395, 0.04, step)] * 2))
    in_ring = np.maximum(abs(x), abs(y)) > 0.012
    local = pose.apply(pose.inverse(T_face @ OVER), np.column_stack([x, y, 0 * x]))
    u = local[:, 0]
    v = local[:, 1]
    in_u = (np.maximum(abs(u), abs(v)) < 0.03) & ~((abs(u) < 0.01) & (v > 0))
    counted = step**2 * np.count_nonzero(in_ring & in_u)
    assert compute_overlap(U_SHAPE, T_face @ OVER, ring(0.04, 0.012), EYE).area == pytest.approx(counted, abs=1.2e-4)


@given(st.lists(st.tuples(flat_poses, poses), min_size=1, max_size=6))
@settings(max_examples=20, deadline=None)
def test_many_pairs_in_one_call_are_as_each_alone(placed: list[tuple[Array, Array]]):
    faces = [U_SHAPE, ring(0.04, 0.012), rectangle(0.03, 0.02)]
    pairs = [FacePair(faces[i % 3], T_on @ T @ OVER, faces[i // 3], T_on) for i, (T, T_on) in enumerate(placed)]
    pairs.append(FacePair(U_SHAPE, pose.at((0, 0, 0), (90, 0, 0)), U_SHAPE, EYE))
    together = compute_overlaps(pairs)
    for pair, found in zip(pairs, together, strict=True):
        alone = compute_overlap(*pair)
        assert found.area == pytest.approx(alone.area, abs=1e-15)
        np.testing.assert_allclose(found.corners, alone.corners, rtol=0, atol=1e-9)
    assert compute_overlaps([]) == []
    assert compute_shares(together, together).tolist() == pytest.approx([1.0] * len(pairs))
