"""Parts of revolution: which are, and the turn that brings one nearest to where it should be."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench.geometry import Solid, find_least_rotated_pose, find_revolution, pose
from tests import rounds


@given(st.integers(0, 10**6), st.sampled_from([rounds.peg(), rounds.plug()]))
@settings(max_examples=12, deadline=None)
def test_the_turn_is_the_least_there_is(seed: int, part: Solid) -> None:
    """No other turn about the axis, nor end for end where that is allowed, leaves less between the two poses."""
    rng = np.random.default_rng(seed)
    found = find_revolution(part)
    assert found is not None
    T = pose.exp(rng.standard_normal(6))
    true = pose.exp(rng.standard_normal(6))
    best = find_least_rotated_pose(part, T, true)

    def turn(X: np.ndarray) -> float:
        return float(np.linalg.norm(pose.log(pose.inverse(true) @ X)[3:]))

    c = pose.at(found.point)
    flips = [np.eye(4), pose.at((0, 0, 0), (180, 0, 0))] if found.reversible else [np.eye(4)]
    others = [
        T @ c @ flip @ pose.at((0, 0, 0), (0, 0, angle)) @ pose.inverse(c)
        for flip in flips
        for angle in np.arange(0.0, 360.0, 1.0)
    ]
    assert turn(best) <= min(map(turn, others)) + 1e-9
    assert min(float(np.abs(best - other).max()) for other in others) < 0.01
