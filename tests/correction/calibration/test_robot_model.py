"""The forward model of a robot that is wrong: its parts against each other."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from apo_bench.correction.calibration.robot_model import (
    Places,
    compute_part_poses,
    grasp_in,
    hand_eye_displacement,
    tip_displacement,
)
from apo_bench.geometry import Array, pose

pytestmark = pytest.mark.numeric

JOINTS = 6
UNKNOWNS = grasp_in(JOINTS, 1).stop


def anywhere(rng: np.random.Generator) -> Array:
    return pose.at(rng.uniform(-1.0, 1.0, 3), rng.uniform(-180.0, 180.0, 3))


def some_places(rng: np.random.Generator) -> Places:
    """Of the second grasp, of the first, and of the empty hand."""
    B, held = (np.array([anywhere(rng) for _ in range(3)]) for _ in range(2))
    return Places(B, rng.uniform(-1.0, 1.0, (3, 6, JOINTS)), held, np.array([1, 0, -1]))


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10**6))
def test_a_part_is_where_its_factors_put_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    unknowns = 0.1 * rng.standard_normal(UNKNOWNS)
    middle = rng.uniform(-1.0, 1.0, 3)
    places = some_places(rng)
    T, D = compute_part_poses(unknowns, middle, places)
    for i, (B, J, held, grasp) in enumerate(zip(*places, strict=True)):
        slip = pose.exp(unknowns[grasp_in(JOINTS, grasp)]) if grasp >= 0 else np.eye(4)
        tip = hand_eye_displacement(unknowns, middle) @ B @ tip_displacement(unknowns, J)
        assert_allclose(T[i], tip @ slip @ held, atol=1e-14)
        others = [k for k in (0, 1) if k != grasp]
        assert not any(D[i, :, grasp_in(JOINTS, k)].any() for k in others)
