"""Other starts of the solver, for cases in which the observed poses lead to no solution or to a distant one.

Far from the observed poses the equations are strongly nonlinear. The solver may end with faces that look the same way,
with open contacts, or in a local minimum. Other starts come from contacts, which state how a part lies on others, and
from symmetries, since a part may have been observed turned. Of all solutions the one nearest to the observation is
taken, in the metric of the noise.
"""

from collections.abc import Collection, Iterator

import numpy as np

from apo_bench.assembly import find_equation_pattern, find_faces_away, find_largest_residual
from apo_bench.correction.contact.inferred import infer_poses
from apo_bench.correction.contact.problem import Problem, problem_of
from apo_bench.correction.contact.solved import FAR_DEG, Solved, solve
from apo_bench.correction.solvers import (
    LARGEST_DENSE,
    LARGEST_POSTERIOR,
    descend_to_nearest,
    factor_covariance,
    find_nearest_poses,
    project_vertices,
    whiten_poses,
)
from apo_bench.geometry import Array, find_symmetries

_SHORTER = 1.0 - 1e-6
"""One squared length is shorter than another one if their ratio is below this; the rest is rounding."""
_MOST = 8
"""Most operations for which starts are made."""


def best_start(problem: Problem, first: Solved) -> tuple[Problem, Solved]:
    """The problem with the start that leads to the nearest solution, and that solution; unchanged if no start is
    better.

    No other starts are tried if no pose is turned far and the faces oppose: open contacts then contradict each other.

    Args:
        first: The solution from the observed poses.
    """
    observed = problem.poses[0]
    usable = _holds(problem, first)
    if not first.far and (usable or _faces_oppose(problem, observed, first.poses)):
        return problem, first
    if 6 * len(observed) > LARGEST_POSTERIOR:
        return problem, first
    usable = usable and _is_flush(problem, first)
    length = float(first.z @ first.z) * _SHORTER if usable else np.inf
    for poses in _solutions(problem, _starts(problem, first)):
        begun = _begun_at(problem, poses)
        if begun.begin is None or np.square(begun.begin).sum() >= length:
            break
        solved = solve(begun, begun.all_contacts)[0]
        if solved.z @ solved.z < length and _holds(begun, solved) and _is_flush(begun, solved):
            return begun, solved
    return problem, first


def describe_turns(problem: Problem, poses: Array) -> str:
    """State which operations were observed turned, if another start was needed to find the corrected poses."""
    if problem.begin is None:
        return ""
    R = np.swapaxes(problem.observation.poses[:, :3, :3], 1, 2) @ poses[:, :3, :3]
    angles = np.degrees(np.arccos(np.clip((np.trace(R, axis1=1, axis2=2) - 1.0) / 2.0, -1.0, 1.0)))
    far = [f"operation {k + 1} by {angle:.0f} degrees" for k, angle in enumerate(angles) if angle > FAR_DEG]
    return f"; seen turned: {', '.join(far)}" if far else ""


def _holds(problem: Problem, solved: Solved) -> bool:
    """Whether the solver converged, every contact holds, and faces in contact oppose."""
    holds = solved.at_rest and solved.finite and solved.worst_m <= problem.observation.gap_m
    return bool(holds and _faces_oppose(problem, solved.poses))


def _faces_oppose(problem: Problem, *poses: Array) -> bool:
    """Whether the faces of every contact oppose, at each of some poses, (n, 4, 4)."""
    return not find_faces_away(problem.observation.assembly, problem.observation.start, np.array(poses)).any()


def _is_flush(problem: Problem, solved: Solved) -> bool:
    """Whether contacts also hold with vertices projected at the solution.

    Vertices that were projected onto a face observed edge-on lie on one line and constrain too little.
    """
    return find_largest_residual(_begun_at(problem, solved.poses).gaps(solved.poses[None])) <= problem.observation.gap_m


def _begun_at(problem: Problem, poses: Array) -> Problem:
    """The problem with start and projected vertices at these poses, (n, 4, 4)."""
    return problem_of(problem.observations, problem.level, poses[None])


def _starts(problem: Problem, first: Solved) -> Array:
    """Start poses to try, (b, n, 4, 4): doubtful operations inferred from contacts, or turned by symmetries."""
    observation = problem.observation
    doubted = _find_doubtful(problem, first)
    n = len(observation.poses)
    starts = [infer_poses(observation, some).poses for some in (*((k,) for k in doubted), tuple(range(n)))]
    turned = [observation.poses]
    for k in doubted:
        for g in find_symmetries(observation.assembly.solids[observation.assembly.operations[k].main])[1:]:
            poses = np.array(observation.poses)
            poses[k] = poses[k] @ g
            turned.append(poses)
    # turned[0] is the observation: a turn is tried only if fewer faces then look the same way.
    away = find_faces_away(observation.assembly, observation.start, np.array(turned)).sum(axis=1)
    return np.array([*starts, *(poses for poses, count in zip(turned, away, strict=True) if count < away[0])])


def _find_doubtful(problem: Problem, first: Solved) -> Collection[int]:
    """Operations that may be far off: all of a few, else those with most violated contacts, at most `_MOST`."""
    observation = problem.observation
    n = len(problem.observation.poses)
    if n <= _MOST:
        return range(n)
    bad = find_faces_away(observation.assembly, observation.start, first.poses)
    bad |= ~(first.gaps <= observation.gap_m)
    letters = find_equation_pattern(observation.assembly).letters[bad] - len(observation.assembly.solids)
    counts = np.bincount(letters[(letters >= 0) & (letters < n)], minlength=n)
    turned = np.einsum("nij,nij->n", observation.poses[:, :3, :3], first.poses[:, :3, :3])
    return sorted(np.lexsort((turned, -counts))[:_MOST].tolist())


def _solutions(problem: Problem, starts: Array) -> Iterator[Array]:
    """Yield consistent poses, (n, 4, 4), with opposing faces, found from the starts, the nearest to the observation
    first.
    """
    observation = problem.observation
    (b, n, *_) = starts.shape
    L = factor_covariance(observation.covariance)
    start = np.array([observation.start[part] for part in observation.assembly.solids]).reshape(-1, 4, 4)
    laid = project_vertices(observation.assembly, start, problem.demands.plane, starts)
    system = laid.system.among(problem.demands.exact)
    z = whiten_poses(observation.poses, L, starts)
    if 6 * n <= LARGEST_DENSE:
        seen = np.broadcast_to(observation.poses, starts.shape)
        results = [find_nearest_poses(system, seen, np.broadcast_to(L, (b, *L.shape)), None, z)]
    else:
        result = (system.only(i) for i in range(b))
        results = [find_nearest_poses(part, observation.poses, L, None, at) for part, at in zip(result, z, strict=True)]
    poses = np.concatenate([result.poses.reshape(-1, n, 4, 4) for result in results])
    rest = np.concatenate([np.atleast_1d(result.at_rest) for result in results])
    e = np.concatenate([np.atleast_2d(result.e) for result in results])
    holds = np.isfinite(poses).all(axis=(1, 2, 3)) & (np.abs(e).max(axis=1, initial=0.0) <= observation.gap_m)
    holds &= ~find_faces_away(observation.assembly, observation.start, poses).any(axis=1)
    # The nearest first, since only the nearest that holds is of use.
    z = whiten_poses(observation.poses, problem.L[0], poses[holds])
    for i in np.flatnonzero(holds)[np.argsort(np.square(z).sum(axis=1))]:
        if rest[i] or 6 * n > LARGEST_DENSE:
            yield poses[i]
        else:
            yield descend_to_nearest(system.only(int(i)), observation.poses, L, poses[i])
