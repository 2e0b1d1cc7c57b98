"""The consistency test of a hypothesis that was chosen for what it explains."""

from dataclasses import replace

import numpy as np

from apo_bench.assembly import Consistency
from apo_bench.correction.checks.chi_square import ROUNDING, p_value
from apo_bench.correction.contact.problem import problem_of, seen_system
from apo_bench.correction.robust.beliefs import BROAD, DISPLACED, INLIER, SHIFTED
from apo_bench.correction.robust.hypotheses import SolvedHypothesis
from apo_bench.correction.solvers import (
    SMALLEST,
    compute_jacobian_rank,
    factor_noise,
    linearise_by,
    whiten_twists,
)
from apo_bench.geometry import Array, compute_right_jacobian, pose


def retest_as_chosen(solved: SolvedHypothesis) -> Consistency | None:
    """The test of a hypothesis without the directions that it chose freely; None for errors with tails.

    A view that is too near or too far, seen badly, or displaced with others may be off by any amount, so what explains
    that amount is no evidence. Of chi-square its share in these directions is subtracted, and their number of the
    degrees of freedom (Rao, "Linear Statistical Inference and its Applications", 4a).
    """
    test = solved.test
    observation = solved.observation
    D = _chosen_directions(solved)
    if test is None or not D.shape[1] or not solved.correction.ok:
        return test
    if observation.tails is not None:
        return None
    kept = observation.assembly.without(solved.dropped)
    system = seen_system(observation).among(kept)
    poses = solved.correction.poses
    L = factor_noise(observation)
    xi = pose.log(pose.inverse(observation.poses) @ poses)
    A = compute_right_jacobian(xi)
    _, Jt = linearise_by(system, poses, A @ L)
    _, own = linearise_by(system, poses, A)
    U = own.T @ D
    play = problem_of((observation,)).play_covariance(kept)
    S = Jt.T @ Jt + (0.0 if play is None else play)
    S += ROUNDING * S.diagonal().max(initial=SMALLEST) * np.eye(len(S))
    pulled = np.linalg.solve(S, np.column_stack([U, Jt.T @ whiten_twists(L, xi)]))
    share = U.T @ pulled
    chosen = float(share[:, -1] @ np.linalg.lstsq(share[:, :-1], share[:, -1])[0])
    if test is not solved.correction.test:
        chosen /= solved.scale**2
    chi_square = max(0.0, test.chi_square - chosen)
    freedom = max(0, test.freedom - compute_jacobian_rank(U))
    return replace(test, chi_square=chi_square, freedom=freedom, p_value=p_value(chi_square, freedom))


def _chosen_directions(solved: SolvedHypothesis) -> Array:
    """Body twists of all operations that a hypothesis chose freely, (6 n, d)."""
    poses = solved.correction.poses
    n = len(poses)
    columns = list[Array]()
    displaced = np.zeros((n, 6, 6))
    for k, state in enumerate(solved.states):
        belief = state[0] if len(state) == 1 else INLIER
        free = np.zeros((n, 6, 6))
        if belief == BROAD:
            free[k] = np.eye(6)
        elif belief == SHIFTED:
            ray = solved.case.views[k][0].ray
            free[k, :3, :3] = np.eye(3) if ray is None else np.outer(ray, ray)
        elif belief == DISPLACED:
            displaced[k] = pose.adjoint(pose.inverse(poses[k]))
        columns.append(free.reshape(6 * n, 6))
    D = np.column_stack([*columns, displaced.reshape(6 * n, 6)])
    return D[:, np.abs(D).max(axis=0) > 0.0]
