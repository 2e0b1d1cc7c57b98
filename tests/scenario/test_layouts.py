"""Many layouts at once are those that are drawn one after the other."""

from __future__ import annotations

import numpy as np
import pytest

from apo_bench import draw_layout, load_scenario
from apo_bench.scenario import scenario_names
from apo_bench.scenario.layout import draw_layouts


@pytest.mark.parametrize("name", scenario_names())
@pytest.mark.parametrize("clearance_mm", [None, 1.0])
def test_they_are_those_drawn_one_after_the_other(name: str, clearance_mm: float | None) -> None:
    scenario = load_scenario(name)
    many = draw_layouts(scenario, np.random.default_rng(5), 4, clearance_mm)
    rng = np.random.default_rng(5)
    for i in range(4):
        one = draw_layout(scenario, rng, clearance_mm)
        np.testing.assert_allclose(many.goals[i], one.poses, rtol=0.0, atol=1e-14)
        assert many.start.keys() == one.start.keys()
        for part, T in one.start.items():
            np.testing.assert_allclose(many.start[part][i], T, rtol=0.0, atol=1e-14)
