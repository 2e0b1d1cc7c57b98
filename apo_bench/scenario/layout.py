"""Layouts: draw the true poses of a trial from a seed."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Layout, Poses
from apo_bench.geometry import Array, measure_extent, pose, shrink_pieces
from apo_bench.scenario.scenario import Scenario


@check_arguments
def draw_layout(scenario: Scenario, rng: np.random.Generator, clearance_mm: float | None = None) -> Layout:
    """Draw the true poses of a trial; every contact of the scenario holds.

    Uniform draws in this order: x, y and yaw of the site, then one for each shift and one for each turn of the
    scenario. Only fixed parts that follow the site move with it; all others start as the scenario states.

    Args:
        scenario: From `load_scenario`.
        rng: The only source of chance.
        clearance_mm: Clearance per side. Default: that of the scenario. A part that stands on a fit face at its start
            stands lower by it.

    Examples:
        >>> import apo_bench, numpy as np
        >>> scenario = apo_bench.load_scenario("stick_in_tower")
        >>> apo_bench.draw_layout(scenario, np.random.default_rng(7)).poses.shape
        (3, 4, 4)
    """
    site = scenario.site
    spans = [site.yaw_rad, *((shift.low_m, shift.high_m) for shift in scenario.shifts)]
    spans += [(turn.low_rad, turn.high_rad) for turn in scenario.turns]
    unit = rng.uniform(-1.0, 1.0, size=2 + len(spans))
    x, y = np.asarray(site.center_m) + unit[:2] * site.spread_m
    yaw, *varied = (0.5 * (a + b) + 0.5 * (b - a) * u for (a, b), u in zip(spans, unit[2:], strict=True))
    shifts = varied[: len(scenario.shifts)]
    turns = varied[len(scenario.shifts) :]
    clearance = scenario.clearance_mm if clearance_mm is None else clearance_mm
    return place_layout(scenario, x, y, yaw, shifts, clearance, turns)


def place_layout(
    scenario: Scenario,
    x_m: float,
    y_m: float,
    yaw_rad: float,
    shifts_m: Sequence[float] | None = None,
    clearance_mm: float = 0.0,
    turns_rad: Sequence[float] | None = None,
) -> Layout:
    """Compute the layout for given values of all variations.

    Target poses are T_world_assembly T_assembly_part, each shifted, then turned, in the frame of its own part.

    Args:
        x_m: Position of the assembly on the table, like `y_m`.
        yaw_rad: Rotation of the assembly about the vertical.
        shifts_m: One per shift of the scenario. Default: zeros.
        clearance_mm: Clearance per side; parts that stand on a fit face start lower by it.
        turns_rad: One per turn of the scenario. Default: zeros.
    """
    T_world_assembly = pose.at((x_m, y_m, 0.0), (0.0, 0.0, np.degrees(yaw_rad)))
    goals = T_world_assembly @ scenario.nominal_poses
    lengths = [0.0] * len(scenario.shifts) if shifts_m is None else shifts_m
    for shift, length in zip(scenario.shifts, lengths, strict=True):
        goals[shift.operation] = goals[shift.operation] @ pose.at(length * shift.axis)
    angles = [0.0] * len(scenario.turns) if turns_rad is None else turns_rad
    for turn, angle in zip(scenario.turns, angles, strict=True):
        goals[turn.operation] = goals[turn.operation] @ turn.by(angle)
    start = {part: T_world_assembly @ T if part in scenario.follows_site else T for part, T in scenario.start.items()}
    return Layout(goals, {part: _lower_to_rest(scenario, part, T, 1e-3 * clearance_mm) for part, T in start.items()})


def _lower_to_rest(scenario: Scenario, part: str, T: Array, clearance_m: float) -> Array:
    """The start pose (4, 4) of a part with clearance: lowered until its lowest point is at that of the nominal part."""
    solid = scenario.assembly.solids[part]
    if part in scenario.assembly.fixed or clearance_m == 0.0 or not solid.fits:
        return T
    lowered = np.array(T)
    lowered[2, 3] -= (
        measure_extent(shrink_pieces(solid, clearance_m), T[2, :3])[0] - measure_extent(solid.pieces, T[2, :3])[0]
    )
    return lowered


def find_nominal_start(scenario: Scenario) -> Poses:
    """The start pose (4, 4) of every part in the frame of the assembly, with the site in the middle of its range."""
    x, y = scenario.site.center_m
    low, high = scenario.site.yaw_rad
    back = pose.inverse(pose.at((x, y, 0.0)) @ pose.exp([0.0, 0.0, 0.0, 0.0, 0.0, (low + high) / 2]))
    return {part: T if part in scenario.follows_site else back @ T for part, T in scenario.start.items()}


class Layouts(NamedTuple):
    """The true poses of n trials."""

    poses: Array
    """(n, k, 4, 4): target poses of k operations, world frame, [m]."""
    start: Poses
    """Part -> start poses, (n, 4, 4), world frame, [m]."""


def draw_layouts(scenario: Scenario, rng: np.random.Generator, n: int) -> Layouts:
    """Draw n layouts one after the other with `draw_layout`."""
    layouts = [draw_layout(scenario, rng) for _ in range(n)]
    goals = np.array([layout.poses for layout in layouts])
    return Layouts(goals, {part: np.array([layout.start[part] for layout in layouts]) for part in scenario.start})
