"""Solvers of the contact equations, and models of how far play lets these equations be off."""

from apo_bench.correction.solvers.compact import CompactEquations, build_compact_equations, linearise_by
from apo_bench.correction.solvers.gauss_newton import (
    LARGEST_DENSE,
    SMALLEST,
    NearestPoses,
    find_nearest_poses,
    solve_batch,
)
from apo_bench.correction.solvers.inequalities import (
    Inequalities,
    bound_contacts,
    compute_violations,
    count_active_directions,
    find_nearest_between,
    list_contact_demands,
)
from apo_bench.correction.solvers.newton import (
    LENGTH_M,
    REST_M,
    SINGULAR_CUT_OFF,
    Solution,
    compute_least_step,
    solve_newton,
)
from apo_bench.correction.solvers.newton_descent import descend_to_nearest
from apo_bench.correction.solvers.play import count_plays, fit_covariance
from apo_bench.correction.solvers.posterior import (
    LARGEST_POSTERIOR,
    RANK_CUT_OFF,
    Freedom,
    compute_freedom,
    compute_jacobian_rank,
    compute_marginals,
    compute_projections,
    settle_basis,
)
from apo_bench.correction.solvers.projected_contacts import ProjectedContacts, project_vertices
from apo_bench.correction.solvers.whitened import (
    WhitenedPoses,
    factor_covariance,
    factor_noise,
    unwhiten_twists,
    whiten_poses,
    whiten_twists,
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
    "WhitenedPoses",
    "bound_contacts",
    "build_compact_equations",
    "compute_freedom",
    "compute_jacobian_rank",
    "compute_least_step",
    "compute_marginals",
    "compute_projections",
    "compute_violations",
    "count_active_directions",
    "count_plays",
    "descend_to_nearest",
    "factor_covariance",
    "factor_noise",
    "find_nearest_between",
    "find_nearest_poses",
    "fit_covariance",
    "linearise_by",
    "list_contact_demands",
    "project_vertices",
    "settle_basis",
    "solve_batch",
    "solve_newton",
    "unwhiten_twists",
    "whiten_poses",
    "whiten_twists",
)
