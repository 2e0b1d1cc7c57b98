"""Solve a pose for the contacts of its own operation alone.

A pose that is no candidate is executed all the same, and a small error in it does harm: a fixture put down tilted stays
wedged in the fingers that let go of it.
"""

from apo_bench.assembly import (
    Equations,
)
from apo_bench.correction.solvers import solve_newton
from apo_bench.geometry import Array


def solve_own_contacts(system: Equations, poses: Array, k: int, gap_m: float) -> Array:
    """The poses (n, 4, 4) with that of operation k solved for what it makes, unless that opens a contact that held.

    Args:
        system: All equations that the pose has to respect, those of other operations too.
        gap_m: Largest |e| at which a contact holds, [m].
    """
    solution = solve_newton(system.among(system.made == k), poses, (k,))
    held = system.gaps(poses) <= gap_m
    holds = system.gaps(solution.poses) <= gap_m
    return solution.poses if solution.finite and (holds | ~held).all() else poses
