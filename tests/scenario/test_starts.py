"""How far parts would fall, and which of them start in the air."""

from __future__ import annotations

import pytest

from apo_bench import load_scenario
from apo_bench.geometry import pose
from apo_bench.scenario.layout import place_layout
from apo_bench.scenario.operation_order import LARGEST_START_GAP_M, find_floating_part
from apo_bench.scenario.scenario_file import list_scenario_names


@pytest.mark.parametrize("name", list_scenario_names())
def test_every_part_starts_on_something(name: str) -> None:
    scenario = load_scenario(name)
    for clearance_mm in (0.0, 0.25, 1.0):
        start = place_layout(scenario, 0.1, 0.0, 0.0, clearance_mm=clearance_mm).start
        assert find_floating_part(scenario.assembly, start) is None


@pytest.mark.parametrize(("up_mm", "found"), [(0.09, False), (0.11, True)])
def test_a_start_in_the_air_is_found_from_a_tenth_of_a_millimetre_on(up_mm: float, found: bool) -> None:
    scenario = load_scenario("stick_on_castles")
    up = pose.at((0.0, 0.0, 1e-3 * up_mm))
    start = {**scenario.start, "stick": up @ scenario.start["stick"]}
    said = find_floating_part(scenario.assembly, start)
    assert LARGEST_START_GAP_M == 1e-4
    assert (said == ("stick", "'stick' starts in the air, 0.11 mm above 'table'")) == found
