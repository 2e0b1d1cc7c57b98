"""Turns with which a part nearly covers itself: shares that are known by hand, and what is left out."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from apo_bench import load_scenario
from apo_bench.geometry import find_approximate_symmetries, find_symmetries, is_rigid, pose
from tests import scenes

pytestmark = pytest.mark.numeric

NEAR = 0.05
"""Shares are measured at about 500 points."""


def test_a_box_that_is_nearly_a_cube_is_turned_by_quarters_too() -> None:
    """Half sizes 10, 10, 9 mm: a quarter turn about x lays 20 by 18 over 18 by 20, which cover 18 of 20."""
    flips = find_approximate_symmetries(scenes.cuboid("nearly", (20, 20, 18)))
    assert len(flips.turns) == 9
    assert int(flips.exact.sum()) == 5
    assert_allclose(flips.shares[flips.exact], 1.0)
    assert_allclose(flips.shares[~flips.exact], 0.9, atol=NEAR)


@pytest.mark.parametrize("name", ["vanished_fixture", "nested_bushings"])
def test_turns_are_about_the_centre_of_volume_and_known_symmetries_are_marked(name: str) -> None:
    for solid in load_scenario(name).assembly.solids.values():
        flips = find_approximate_symmetries(solid)
        assert is_rigid(flips.turns).all()
        for F, exact in zip(flips.turns, flips.exact, strict=True):
            assert_allclose(pose.apply(F, solid.centroid[None])[0], solid.centroid, atol=1e-12)
            assert exact == (np.abs(find_symmetries(solid) - F).max(axis=(1, 2)) < 1e-6).any()
            assert np.abs(F - np.eye(4)).max() > 0.5
