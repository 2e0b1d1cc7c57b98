"""How far parts would fall, and which of them start in the air."""

from __future__ import annotations

import numpy as np
import pytest

from apo_bench.geometry import pose
from apo_bench.geometry.drop import TOUCH_M, drop
from apo_bench.geometry.solid import Box, Solid
from apo_bench.scenario.file import load_scenario, scenario_names
from apo_bench.scenario.layout import layout_at
from apo_bench.scenario.starts import AIR_M, in_the_air


def cuboid(*half: float) -> Solid:
    return Solid("cuboid", {}, (Box("cuboid", np.zeros(3), np.array(half)),), np.zeros(3), 8 * float(np.prod(half)))


SLAB, CUBE = cuboid(0.4, 0.4, 0.001), cuboid(0.02, 0.02, 0.02)


@pytest.mark.parametrize("height", [0.0, 1e-5, 0.0123, 1.5])
@pytest.mark.parametrize("turn", [(0, 0, 0), (0, 0, 30), (45, 0, 0), (20, 30, 40)])
def test_a_cube_falls_until_its_lowest_corner_touches(height: float, turn: tuple[float, float, float]) -> None:
    T = pose.at((0.05, 0.03, 0.0), turn)
    T[2, 3] = 0.001 + height + 0.02 * np.abs(T[2, :3]).sum()
    assert drop(CUBE, T, SLAB, np.eye(4)) == pytest.approx(height, abs=3 * TOUCH_M)


@pytest.mark.parametrize("at", [(0.5, 0.0, 0.1), (0.42, 0.0, 0.1), (0.0, 0.0, -0.1)])
def test_what_is_beside_or_below_is_passed_by(at: tuple[float, float, float]) -> None:
    """Also a wall along which the cube slides down."""
    assert drop(CUBE, pose.at(at), SLAB, np.eye(4)) == np.inf


def test_a_castle_stands_in_the_shadow_of_another_one_and_falls_past_it() -> None:
    """Boxes around both lie over one another, the cubes do not."""
    T, other = pose.at((0.0, 0.0, 0.1), (0, 0, 45)), pose.at((0.035, 0.035, 0.0), (0, 0, 45))
    assert drop(CUBE, T, CUBE, other) == np.inf
    assert drop(CUBE, T, CUBE, pose.at((0.025, 0.025, 0.0), (0, 0, 45))) == pytest.approx(0.06, abs=3 * TOUCH_M)


@pytest.mark.parametrize("name", scenario_names())
def test_every_part_starts_on_something(name: str) -> None:
    scenario = load_scenario(name)
    for clearance_mm in (0.0, 0.25, 1.0):
        start = layout_at(scenario, 0.1, 0.0, 0.0, clearance_mm=clearance_mm).start
        assert in_the_air(scenario.assembly, start) is None


@pytest.mark.parametrize(("up_mm", "found"), [(0.09, False), (0.11, True)])
def test_a_start_in_the_air_is_found_from_a_tenth_of_a_millimetre_on(up_mm: float, found: bool) -> None:
    scenario = load_scenario("stick_on_castles")
    up = pose.at((0.0, 0.0, 1e-3 * up_mm))
    start = {**scenario.start, "stick": up @ scenario.start["stick"]}
    said = in_the_air(scenario.assembly, start)
    assert AIR_M == 1e-4
    assert (said == ("stick", "'stick' starts in the air, 0.11 mm above 'table'")) == found
