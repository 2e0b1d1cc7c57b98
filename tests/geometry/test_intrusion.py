"""How deep solids are in each other: laws, and blocks by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench.geometry import Array, Box, Solid, pose
from apo_bench.geometry.penetration import measure_intrusion

coordinates = st.floats(-0.1, 0.1)
turns = st.floats(-180, 180)
poses = st.builds(pose.at, st.tuples(*[coordinates] * 3), st.tuples(*[turns] * 3))


def block(*half: float) -> Solid:
    return Solid("block", {}, (Box("block", np.zeros(3), np.array(half)),), np.zeros(3), 8 * float(np.prod(half)))


@given(poses, poses)
@settings(max_examples=40, deadline=None)
def test_intrusion_is_symmetric_and_moves_with_the_pair(T: Array, T_both: Array):
    a = block(0.03, 0.02, 0.01)
    b = block(0.05, 0.01, 0.04)
    depth = measure_intrusion(a, np.eye(4), b, T)
    assert measure_intrusion(b, T, a, np.eye(4)) == pytest.approx(depth, abs=1e-12)
    assert measure_intrusion(a, T_both, b, T_both @ T) == pytest.approx(depth, abs=1e-9)
