"""How deep solids are in each other: laws, points in common, and blocks by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench.geometry import Array, Box, Solid, intrusion_depths, pose
from apo_bench.geometry.penetration import intrusion
from tests import scenes

coordinates = st.floats(-0.1, 0.1)
turns = st.floats(-180, 180)
poses = st.builds(pose.at, st.tuples(*[coordinates] * 3), st.tuples(*[turns] * 3))


def block(*half: float) -> Solid:
    return Solid("block", {}, (Box("block", np.zeros(3), np.array(half)),), np.zeros(3), 8 * float(np.prod(half)))


@given(poses, poses)
@settings(max_examples=100, deadline=None)
def test_intrusion_is_symmetric_and_moves_with_the_pair(T: Array, T_both: Array):
    a = block(0.03, 0.02, 0.01)
    b = block(0.05, 0.01, 0.04)
    depth = intrusion(a, np.eye(4), b, T)
    assert intrusion(b, T, a, np.eye(4)) == pytest.approx(depth, abs=1e-12)
    assert intrusion(a, T_both, b, T_both @ T) == pytest.approx(depth, abs=1e-9)


@given(poses)
@settings(max_examples=100, deadline=None)
def test_intrusion_agrees_with_points(T: Array):
    """A common point well inside both boxes means intrusion; boxes pushed apart by the depth only touch."""
    a = block(0.03, 0.02, 0.01)
    b = block(0.05, 0.01, 0.04)
    grid = np.stack(np.meshgrid(*[np.linspace(-0.95, 0.95, 9)] * 3), axis=-1).reshape(-1, 3)
    inside = np.abs(pose.apply(pose.inverse(T), grid * a.pieces[0].half)) < 0.95 * b.pieces[0].half
    depth = intrusion(a, np.eye(4), b, T)
    if inside.all(axis=1).any():
        assert depth > 0
    if depth == 0:
        assert not inside.all(axis=1).any()


@pytest.mark.parametrize(("apart_mm", "depth_mm"), [(19.0, 1.0), (20.0, 0.0), (21.0, 0.0)])
def test_the_depth_of_two_aligned_blocks(apart_mm: float, depth_mm: float):
    a = block(0.05, 0.05, 0.01)
    assert 1e3 * intrusion(a, np.eye(4), a, pose.at((0, 0, 1e-3 * apart_mm))) == pytest.approx(depth_mm, abs=1e-9)


def test_depths_of_boxes_at_many_places_are_those_of_the_solids() -> None:
    a = scenes.block("a")
    b = scenes.block("b")
    T_a = pose.at((0, 0, 0), (0, 0, 30))
    T_b = pose.at((0.02, 0.01, 0.03), (10, 0, 0))
    at = np.array([[0.0, 0.0, 0.0], [0.04, 0.0, 0.01], [0.2, 0.0, 0.0]])
    found = intrusion_depths(a.pieces, T_a[:3, :3], at, b.pieces, T_b)
    for p, depth_m in zip(at, found, strict=True):
        T = np.array(T_a)
        T[:3, 3] = p
        assert max(0.0, depth_m) == pytest.approx(intrusion(a, T, b, T_b), abs=1e-12)
    assert found[2] < -0.1
