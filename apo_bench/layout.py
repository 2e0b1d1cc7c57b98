"""The truth of a trial: where a seed puts the assembly, and how far it shifts what no contact fixes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from apo_bench.geometry import pose
from apo_bench.program import Layout
from apo_bench.scenario import Scenario


def draw_layout(scenario: Scenario, rng: np.random.Generator) -> Layout:
    """A consistent layout: every contact of the scenario stays closed.

    Uniform draws in this order: x, y and yaw of the site, then one for each shift of the scenario. Parts start where
    the scenario says, in the world; only fixed parts that follow the site move with it.
    """
    site, unit = scenario.site, rng.uniform(-1.0, 1.0, size=3 + len(scenario.shifts))
    x, y = np.asarray(site.center_m) + unit[:2] * site.spread_m
    yaw = _between(*site.yaw_rad, unit[2])
    shifts = [_between(shift.low_m, shift.high_m, u) for shift, u in zip(scenario.shifts, unit[3:], strict=True)]
    return layout_at(scenario, x, y, yaw, shifts)


def layout_at(
    scenario: Scenario, x_m: float, y_m: float, yaw_rad: float, shifts_m: Sequence[float] | None = None
) -> Layout:
    """The layout with the assembly at (x, y), turned by yaw about the vertical, and given shifts (none: all zero).

    Goals are T_world_assembly T_assembly_part, each shifted along its axis in the frame of its own part.
    """
    T_world_assembly = pose.at((x_m, y_m, 0.0), (0.0, 0.0, np.degrees(yaw_rad)))
    goals = T_world_assembly @ scenario.goals
    lengths = [0.0] * len(scenario.shifts) if shifts_m is None else shifts_m
    for shift, length in zip(scenario.shifts, lengths, strict=True):
        goals[shift.operation] = goals[shift.operation] @ pose.at(length * shift.axis)
    start = {part: T_world_assembly @ T if part in scenario.follows_site else T for part, T in scenario.start.items()}
    return Layout(goals, start)


def _between(low: float, high: float, unit: float) -> float:
    """The point of an interval that stands for `unit` in -1..1."""
    return 0.5 * (low + high) + 0.5 * (high - low) * unit
