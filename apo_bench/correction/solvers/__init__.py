"""Solvers of the contact equations, and by how much play lets these equations be off."""

from apo_bench.correction.solvers.compact import CompactEquations, compact_equations, linearised_by
from apo_bench.correction.solvers.gauss_newton import LARGEST_DENSE, SMALLEST, NearestPoses, nearest_poses, solve_batch
from apo_bench.correction.solvers.inequalities import (
    Inequalities,
    active_rank,
    bounded,
    demanded,
    nearest_between,
    violations,
)
from apo_bench.correction.solvers.kernels import Kernels
from apo_bench.correction.solvers.newton import LENGTH_M, REST_M, SINGULAR_CUT_OFF, Solution, least_step, solve_newton
from apo_bench.correction.solvers.newton_descent import descended
from apo_bench.correction.solvers.play import fit_covariance, plays
from apo_bench.correction.solvers.posterior import (
    LARGEST_POSTERIOR,
    RANK_CUT_OFF,
    Freedom,
    freedom_of,
    jacobian_rank,
    marginals,
    projections,
    settled_basis,
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
    "Kernels",
    "NearestPoses",
    "ProjectedContacts",
    "Solution",
    "Whitened",
    "active_rank",
    "bounded",
    "compact_equations",
    "coordinates_of",
    "correction_to",
    "demanded",
    "descended",
    "fit_covariance",
    "freedom_of",
    "jacobian_rank",
    "least_step",
    "linearised_by",
    "marginals",
    "nearest_between",
    "nearest_poses",
    "noise_factor",
    "plays",
    "project_vertices",
    "projections",
    "scales",
    "settled_basis",
    "solve_batch",
    "solve_newton",
    "twists_of",
    "violations",
)
