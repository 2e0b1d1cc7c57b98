"""Solve one pose for the contacts that its own operation makes, with all other poses fixed.

Poses that are not adjusted otherwise are executed too, and small errors in them do harm: a fixture put down tilted
stays wedged in the fingers that release it.
"""

from apo_bench.assembly import (
    Equations,
)
from apo_bench.correction.solvers import solve_newton
from apo_bench.geometry import Array


def solve_own_contacts(system: Equations, poses: Array, k: int, gap_m: float) -> Array:
    """The poses, (n, 4, 4), with that of operation k solved for the contacts that it makes.

    The poses are returned unchanged if that would open a contact that held, or if a number is not finite.

    Args:
        system: All equations that must not be violated, those of other operations too.
        gap_m: Largest |e| at which a contact holds, [m].
    """
    solution = solve_newton(system.among(system.made == k), poses, (k,))
    held = system.gaps(poses) <= gap_m
    holds = system.gaps(solution.poses) <= gap_m
    return solution.poses if solution.finite and (holds | ~held).all() else poses
