"""Pose errors of a plan or a replay, split into directions that contacts fix and directions that they leave free."""

import numpy as np

from apo_bench.assembly import Assembly, Poses, ReachedState, build_contact_equations
from apo_bench.correction.solvers import LENGTH_M
from apo_bench.geometry import Array, find_least_rotated_pose, pose

_RANK_CUT_OFF = 1e-7
"""Relative cut-off: at consistent poses singular values of free directions are rounding, the others far larger."""


def measure_pose_errors(
    assembly: Assembly, start: Poses, truth_goals: Array, reached: ReachedState
) -> tuple[float | None, float | None]:
    """The pose errors of the main parts of a replay, each just after its operation, as in `measure_goal_errors`.

    Returns:
        (fixed, free), [mm]; (None, None) if an operation was not finished.
    """
    if any(snapshot is None for snapshot in reached.after):
        return None, None
    at = [s.poses[operation.main] for operation, s in zip(assembly.operations, reached.after, strict=True) if s]
    return measure_goal_errors(assembly, start, truth_goals, np.array(at).reshape(-1, 4, 4))


def measure_goal_errors(assembly: Assembly, start: Poses, truth_goals: Array, goals: Array) -> tuple[float, float]:
    """Root mean square per operation of the error of target poses, in fixed and in free directions, [mm].

    The error of an operation is the body twist from the true pose to the given one. A rotation counts by the motion of
    a point 40 mm from the origin. The rotation of a part of revolution about its axis is no error, unless the part
    carries others. The row space of the Jacobian of the contact equations at the truth holds the fixed directions, its
    null space the free ones.

    Args:
        assembly: With the right relations.
        truth_goals: (n, 4, 4), consistent, world frame, [m].
        goals: (n, 4, 4), world frame, [m].

    Returns:
        (fixed, free).
    """
    # rotations count as ways of a point at LENGTH_M, so that all coordinates are lengths
    unit = np.tile([1.0, 1.0, 1.0, LENGTH_M, LENGTH_M, LENGTH_M], len(assembly))
    goals = _undo_symmetric_rotations(assembly, truth_goals, goals)
    error = pose.log(pose.inverse(truth_goals) @ goals).ravel() * unit
    _, J = build_contact_equations(assembly, start, truth_goals).linearise(truth_goals)
    # de = (J / unit) (unit dxi): the rows of J / unit span the fixed directions, and B^t B projects onto that span
    basis = _find_row_space(J / unit)
    fixed = basis.T @ (basis @ error)
    return _root_mean_square_mm(fixed, len(assembly)), _root_mean_square_mm(error - fixed, len(assembly))


def _undo_symmetric_rotations(assembly: Assembly, truth_goals: Array, goals: Array) -> Array:
    """`goals` with parts of revolution rotated about their axes nearest to the truth, unless they carry others."""
    alone = [None if operation.carries else assembly.solids[operation.main] for operation in assembly.operations]
    pairs = zip(alone, goals, truth_goals, strict=True)
    return np.array(
        [T if solid is None else find_least_rotated_pose(solid, T, true) for solid, T, true in pairs]
    ).reshape(-1, 4, 4)


def _root_mean_square_mm(error: Array, operations: int) -> float:
    """Root mean square of an error, (6 n,), [m], per operation, in mm."""
    return float(np.linalg.norm(error) / np.sqrt(operations)) * 1e3


def _find_row_space(J: Array) -> Array:
    """An orthonormal basis of the row space, (rank, columns)."""
    if not J.size:
        return np.zeros((0, J.shape[1]))
    _, w, Vt = np.linalg.svd(J, full_matrices=False)
    return Vt[w > _RANK_CUT_OFF * w[0]]
