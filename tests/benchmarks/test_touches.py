"""The arm of the static benchmark of touches, and that its regions cover what is drawn."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from apo_bench.geometry import pose
from benchmarks.touches import joints_at, summary, tip_of


def test_the_jacobian_of_the_arm_is_that_of_finite_differences() -> None:
    q = np.array([0.2, -0.1, 0.3, 0.4, -0.2, 0.5])
    T, J = tip_of(q)
    for i, d in enumerate(1e-6 * np.eye(6)):
        ahead, behind = (pose.log(pose.inverse(T) @ tip_of(q + s * d)[0]) for s in (1, -1))
        assert_allclose(J[:, i], (ahead - behind) / 2e-6, atol=1e-8)
    assert_allclose(joints_at(T, np.zeros(6)), q, atol=1e-9)


def test_a_row_says_how_often_regions_cover_the_truth() -> None:
    """40 draws of fixed seeds: not a proof of 95 %, but a factor of two in a sigma would fail."""
    row = summary(40, "hand_eye:0.5/0.1+joints:0.02+tool:0.2+in_hand:0.2/0.5", 20.0)
    assert float(str(row["told_covered"])) >= 85.0
    assert row["right_refused"] == "0.0"
    before, after = (
        np.array(str(row[key]).split(" / "), dtype=float) for key in ("before_mm_deg_deg", "after_mm_deg_deg")
    )
    assert (after < before / 3.0).all()
