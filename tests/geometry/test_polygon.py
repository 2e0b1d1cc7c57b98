"""Corners of rings."""

import numpy as np
import pytest

from apo_bench.geometry import straighten

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def test_points_on_straight_edges_are_no_corners():
    twice = np.stack([SQUARE, (SQUARE + np.roll(SQUARE, -1, axis=0)) / 2], axis=1).reshape(-1, 2)
    assert straighten(twice).tolist() == SQUARE.tolist()


@pytest.mark.parametrize("points", [16, 92])
def test_a_disc_seen_nearly_edge_on_keeps_points(points):
    """Found in a sweep: no point of the sliver turned enough to be a corner, and the judge had nothing to measure."""
    angle = 2 * np.pi * np.arange(points) / points
    ring = np.column_stack([4e-3 * np.cos(angle), 5e-9 * np.sin(angle)])
    assert len(straighten(ring)) > 2
