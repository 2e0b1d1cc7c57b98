"""The compact equations of many goals of one assembly as one array."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from apo_bench.assembly.equations import Equations, pattern
from apo_bench.assembly.topology import Assembly
from apo_bench.correction.solvers.compact import CompactEquations, compact_equations, corner_moments
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array


def compact_many(assembly: Assembly, system: Equations, goals: Array) -> CompactEquations:
    """The compact equations of many observations, goals (b, n, 4, 4), each with the vertices that it gives itself.

    Vertices of the environment's face are the same for all; those of the manipulated face are laid onto the other one
    at each observation's own goals, which takes their centre and axes along, since it is an affine map.

    Args:
        system: The equations of one of them.
    """
    one, known = compact_equations(system, goals.shape[1]), pattern(assembly)
    laid = known.laid
    points = np.array(np.broadcast_to(one.points, (len(goals), *one.points.shape)))
    if laid.any():
        own = corner_moments(known)[laid]
        back = pose.inverse(one.among(laid).words(goals))
        there = own @ np.swapaxes(back, -1, -2)
        plane = known.onto[laid]
        points[:, laid] = there
        points[:, laid, :, :3] -= (there @ plane[:, :, None]) * plane[:, None, :3]
    return replace(one, points=points)
