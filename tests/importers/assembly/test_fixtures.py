"""Fixtures: a part rests in one, is lifted straight out of it, and its file is a part."""

from __future__ import annotations

import numpy as np
import pytest

from apo_bench.geometry import Array, Solid, measure_extent, measure_intrusion_depths, pose
from apo_bench.importers.assembly.fixtures import FLOOR_M, make_fixture
from apo_bench.scenario.parts.making import build_solid, extrude, make_polygon, make_rectangle, make_shaft

BLADE = build_solid("blade", extrude(make_rectangle(1.4, 40), 0, 50))
PARTS = {
    "leaning bar": (build_solid("bar", extrude(make_rectangle(30, 20), 0, 18)), (0, 30, 0)),
    "leaning pin": (build_solid("pin", make_shaft(7, 0, 50, "side")), (0, 25, 0)),
    "lying pin": (build_solid("pin", make_shaft(7, 0, 50, "side")), (0, 90, 0)),
    "angle": (
        build_solid("angle", extrude(make_polygon((0, 0), (40, 0), (40, 10), (10, 10), (10, 34), (0, 34)), 0, 20)),
        (-90, 0, 0),
    ),
    "blade": (BLADE, (0, 0, 0)),
}


def in_fixture(name: str) -> tuple[Solid, Solid, Array]:
    """The part, its fixture, and the part in the frame of the fixture."""
    solid, turn = PARTS[name]
    T = pose.at(np.zeros(3), turn)
    fixture = make_fixture("fixture", solid, T[:3, :3])
    return solid, fixture, pose.at((0.0, 0.0, FLOOR_M - measure_extent(solid.pieces, T[2, :3])[0])) @ T


@pytest.mark.parametrize("name", PARTS)
def test_a_part_rests_in_its_fixture_and_is_lifted_straight_out_of_it(name: str):
    solid, fixture, T = in_fixture(name)
    lifts = np.outer(np.linspace(-2e-5, 0.08, 400), (0.0, 0.0, 1.0))
    depths = measure_intrusion_depths(solid.pieces, T[:3, :3], T[:3, 3] + lifts, fixture.pieces, np.eye(4))
    assert depths[0] > 1e-6  # it would be in it a hair lower
    assert depths[lifts[:, 2] >= 0.0].max() <= 1e-9
