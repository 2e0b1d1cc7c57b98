"""Many layouts of a scenario at once."""

from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Poses
from apo_bench.geometry import Array, pose
from apo_bench.scenario.layout import layout_at
from apo_bench.scenario.scenario import Scenario


class Layouts(NamedTuple):
    """The truth of many trials."""

    goals: Array
    """(n, k, 4, 4): of k operations, world frame, [m]."""
    start: Poses
    """Part -> (n, 4, 4)."""


def draw_layouts(scenario: Scenario, rng: np.random.Generator, n: int, clearance_mm: float | None = None) -> Layouts:
    """Layouts, drawn as `draw_layout` draws them one after the other: equal up to rounding.

    Args:
        clearance_mm: As in `draw_layout`.
    """
    site = scenario.site
    low, high = np.transpose(
        [
            *[(c - half, c + half) for c, half in zip(site.center_m, site.spread_m, strict=True)],
            site.yaw_rad,
            *[(shift.low_m, shift.high_m) for shift in scenario.shifts],
            *[(turn.low_rad, turn.high_rad) for turn in scenario.turns],
        ]
    )
    drawn = (low + high) / 2 + (high - low) / 2 * rng.uniform(-1.0, 1.0, (n, len(low)))
    place = np.zeros((n, 6))
    place[:, [0, 1, 5]] = drawn[:, :3]
    T_world_assembly = pose.exp(place * [0, 0, 0, 1, 1, 1])
    T_world_assembly[:, :3, 3] = place[:, :3]
    fit = scenario.clearance_mm if clearance_mm is None else clearance_mm
    nominal = layout_at(scenario, 0.0, 0.0, 0.0, clearance_mm=fit)
    goals = T_world_assembly[:, None] @ nominal.poses
    lengths, angles = np.split(drawn[:, 3:], [len(scenario.shifts)], axis=1)
    for shift, length in zip(scenario.shifts, lengths.T, strict=True):
        goals[:, shift.operation] = goals[:, shift.operation] @ pose.exp(np.outer(length, [*shift.axis, 0.0, 0.0, 0.0]))
    for turn, angle in zip(scenario.turns, angles.T, strict=True):
        there = pose.at(turn.point)
        by = there @ pose.exp(np.outer(angle, [0.0, 0.0, 0.0, *turn.axis])) @ pose.inverse(there)
        goals[:, turn.operation] = goals[:, turn.operation] @ by
    still = np.broadcast_to(np.eye(4), (n, 4, 4))
    return Layouts(
        goals,
        {part: (T_world_assembly if part in scenario.follows_site else still) @ T for part, T in nominal.start.items()},
    )
