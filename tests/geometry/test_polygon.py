"""Corners of rings."""

import numpy as np
import pytest

from apo_bench.geometry import straighten


@pytest.mark.parametrize("points", [16, 92])
def test_a_disc_seen_nearly_edge_on_keeps_points(points):
    """Found in a sweep: no point of the sliver turned enough to be a corner, and the judge had nothing to measure."""
    angle = 2 * np.pi * np.arange(points) / points
    ring = np.column_stack([4e-3 * np.cos(angle), 5e-9 * np.sin(angle)])
    assert len(straighten(ring)) > 2
