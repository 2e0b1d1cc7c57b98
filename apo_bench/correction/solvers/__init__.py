"""Solvers of the contact equations, and by how much play lets these equations be off."""

from apo_bench.correction.solvers.compact import CompactEquations, compact_equations, linearise_by
from apo_bench.correction.solvers.gauss_newton import LARGEST_DENSE, SMALLEST, NearestPoses, nearest_poses, solve_batch
from apo_bench.correction.solvers.inequalities import (
    Inequalities,
    active_rank,
    bound_contacts,
    demands_of,
    nearest_between,
    violations,
)
from apo_bench.correction.solvers.newton import LENGTH_M, REST_M, SINGULAR_CUT_OFF, Solution, least_step, solve_newton
from apo_bench.correction.solvers.newton_descent import descend_to_nearest
from apo_bench.correction.solvers.play import fit_covariance, plays
from apo_bench.correction.solvers.posterior import (
    LARGEST_POSTERIOR,
    RANK_CUT_OFF,
    Freedom,
    freedom_of,
    jacobian_rank,
    marginals,
    projections,
    settle_basis,
)
from apo_bench.correction.solvers.projected_contacts import ProjectedContacts, project_vertices
from apo_bench.correction.solvers.whitened import (
    Whitened,
    coordinates_of,
    correction_to,
    noise_factor,
    scales,
    twists_of,
)

__all__ = (
    "LARGEST_DENSE",
    "LARGEST_POSTERIOR",
    "LENGTH_M",
    "RANK_CUT_OFF",
    "REST_M",
    "SINGULAR_CUT_OFF",
    "SMALLEST",
    "CompactEquations",
    "Freedom",
    "Inequalities",
    "NearestPoses",
    "ProjectedContacts",
    "Solution",
    "Whitened",
    "active_rank",
    "bound_contacts",
    "compact_equations",
    "coordinates_of",
    "correction_to",
    "demands_of",
    "descend_to_nearest",
    "fit_covariance",
    "freedom_of",
    "jacobian_rank",
    "least_step",
    "linearise_by",
    "marginals",
    "nearest_between",
    "nearest_poses",
    "noise_factor",
    "plays",
    "project_vertices",
    "projections",
    "scales",
    "settle_basis",
    "solve_batch",
    "solve_newton",
    "twists_of",
    "violations",
)
