"""Degrees of freedom of a demonstration: which directions contacts fix, through which relations, and how certainly.

Operations are taken in order: earlier ones are given, later ones adapt. The free directions of operation k are its
block of the null space of the Jacobian without the columns of earlier operations. Counted so, the free dimensions of
all operations add up to the freedom of the whole, and their ranks to its rank.

Uncertainties come from the joint posterior of all poses. A free direction is as uncertain as its observation, or less
if several parts that must move together were observed.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.arguments import check_arguments
from apo_bench.assembly import (
    ODL,
    Assembly,
    Correction,
    Hypothesis,
    Observation,
    Operation,
    Poses,
    compute_placements,
    find_equation_pattern,
    project_observation,
)
from apo_bench.correction.contact.problem import problem_of
from apo_bench.correction.directions import Direction, directions, held
from apo_bench.correction.relation_equations import RelationHold, by_relation, relation_holds
from apo_bench.correction.shared_estimate import SharedEstimate, estimate_shared
from apo_bench.correction.solvers import LARGEST_POSTERIOR, Freedom, compute_freedom, linearise_by, unwhiten_twists
from apo_bench.errors import InputError
from apo_bench.geometry import Array, compute_right_jacobian, pose

_ZERO = 1e-7
"""Components of an orthonormal basis below this are rounding."""


@final
@dataclass(frozen=True, eq=False)
class FreeDirection:
    """A direction that no contact fixes."""

    direction: Direction
    deviation: float
    """Posterior standard deviation along it, [m] for a shift, [rad] for a turn."""
    along: tuple[int, ...] = ()
    """The later operations that must move with it, counted from 0."""


@final
@dataclass(frozen=True, eq=False)
class OperationExplanation:
    """What the contacts fix of one operation, given the earlier operations."""

    operation: int
    """Counted from 0."""
    part: str
    rank: int
    """Number of fixed directions, of six."""
    fixed: tuple[str, ...]
    """Names of the fixed directions."""
    free: tuple[FreeDirection, ...]
    through: tuple[RelationHold, ...]
    """An irreducible set of relations that fixes as much as all of them."""
    agreeing: tuple[RelationHold, ...]
    """Relations made by this operation that are redundant for that."""
    covariance: Array
    """(6, 6), posterior, of the body twist at its pose, [m, rad]."""


@final
@dataclass(frozen=True, eq=False)
class PartExplanation:
    """The final pose of a part in the world, and its uncertainty."""

    part: str
    placed: int
    """The operation that moved it last, counted from 0."""
    odl: ODL
    pose: Array
    """(4, 4), world frame, [m]."""
    rank: int
    """Number of directions that are fixed in the world, of six."""
    fixed: tuple[str, ...]
    """Names of the fixed directions."""
    free: tuple[FreeDirection, ...]
    covariance: Array
    """(6, 6), posterior, of its body twist, [m, rad]."""

    @property
    def deviations(self) -> Array:
        """Posterior standard deviations along the axes of the part, (6,), [m, rad]."""
        return np.sqrt(np.diag(self.covariance))


@final
@dataclass(frozen=True, eq=False)
class Explanation:
    """What the contacts fix of a whole demonstration."""

    assembly: Assembly
    poses: Array
    """(n, 4, 4), where the contacts were linearised, world, [m]."""
    operations: tuple[OperationExplanation, ...]
    parts: tuple[PartExplanation, ...]
    """The parts that were moved, in order of their last placement."""
    rank: int
    """Number of directions that the contacts fix, of all operations."""
    freedom: int
    """Number of free directions, of all operations."""
    redundant: int
    """Equations, three per contact, that follow from the others."""
    spectral_gap: float
    """The smallest singular value that counts over the largest that does not."""
    shared: tuple[SharedEstimate, ...] = ()
    """Estimates of the errors that operations share."""
    left_out: tuple[int, ...] = ()
    """Operations whose observations are all rejected, counted from 0."""
    hypotheses: tuple[Hypothesis, ...] = ()
    """Other explanations of the observation with their weights, as in the correction."""


@check_arguments
def explain(observation: Observation, poses: Array | Correction, dropped: Collection[str] = ()) -> Explanation:
    """Explain which directions the contacts determine, which stay free, and how uncertain each pose is.

    Args:
        observation: The observation, whose covariance gives the uncertainty.
        poses: (n, 4, 4), consistent with every contact, world frame, [m]; or a `Correction`.
        dropped: Relations (R1, R2, ...) to leave out, as inequalities are.

    Returns:
        Free directions of every operation, and posterior standard deviations; `apo-bench inspect dof` prints it.

    Raises:
        InputError: The covariance of an operation is not positive definite, or there are too many operations.
    """
    given = observation.assembly
    left_out = tuple[int, ...]()
    hypotheses = tuple[Hypothesis, ...]()
    if isinstance(poses, Correction):
        left_out = poses.left_out
        hypotheses = poses.hypotheses
        dropped = (*poses.dropped, *dropped)
        observation = poses.assumed or observation
        poses = poses.poses
    observation = project_observation(observation)
    n = len(poses)
    assembly = observation.assembly
    if 6 * n > LARGEST_POSTERIOR:
        raise _too_many(n)
    problem = problem_of((replace(observation, poses=poses, shared=()),))
    system = problem.laid.system.only(0)
    kept = problem.demands.exact & problem.without(tuple(dropped))
    # B = J_r(xi) L makes body twists at the poses of z, so J B is the derivative by z.
    xi = pose.log(pose.inverse(observation.poses) @ poses)
    Jr = compute_right_jacobian(xi)
    B = Jr @ problem.L[0]
    _, Jt = linearise_by(system, poses, B)
    every = relation_holds(assembly)
    relations = by_relation(assembly, system, Jt, kept)
    known = compute_freedom(relations.Jt)
    if known is None:
        raise _too_many(n)
    spans = unwhiten_twists(B, known.free)
    shared = tuple[SharedEstimate, ...]()
    if observation.shared:
        shared, spans = estimate_shared(observation, xi, Jr, system.among(kept))
    explained = []
    for k, own in enumerate(_own_directions(known, n)):
        block = slice(6 * k, 6 * k + 6)
        C = spans[k] @ spans[k].T
        named = directions(B[k] @ own[block])
        needed = relations.holding(k, 6 - own.shape[1])
        explained.append(
            OperationExplanation(
                operation=k,
                part=assembly.operations[k].main,
                rank=6 - own.shape[1],
                fixed=held(named),
                free=tuple(FreeDirection(d, _deviation(C, d), _along(k, own, B[k], d)) for d in named),
                through=tuple(every[i] for i in needed),
                agreeing=tuple(every[i] for i in relations.direct(k) if i not in needed and every[i].made == k),
                covariance=C,
            )
        )
    return Explanation(
        assembly=given,
        poses=poses,
        operations=tuple(explained),
        parts=_standing(assembly, observation.start, poses, B, spans),
        rank=known.rank,
        freedom=known.free.shape[1],
        redundant=known.redundant - _void(assembly, kept),
        spectral_gap=known.spectral_gap,
        shared=shared,
        left_out=left_out,
        hypotheses=hypotheses,
    )


def _void(assembly: Assembly, kept: NDArray[np.bool_]) -> int:
    """Number of compact equations without content: of contacts that are not kept, and of sheets of fewer than three
    points.
    """
    said = np.where(kept, np.minimum(np.diff(find_equation_pattern(assembly).begin), 3), 0)
    return int((3 - said).sum())


def _deviation(C: Array, direction: Direction) -> float:
    """The standard deviation along a direction, [m] or [rad], given the covariance of the body twist, (6, 6)."""
    half = slice(3, 6) if direction.turns else slice(0, 3)
    return float(np.sqrt(direction.axis @ C[half, half] @ direction.axis))


def _too_many(n: int) -> InputError:
    """The error for more operations than can be explained."""
    return InputError(
        f"{n} operations were given; up to {LARGEST_POSTERIOR // 6} can be explained, so take fewer of them."
    )


def _own_directions(known: Freedom, n: int) -> Iterator[Array]:
    """The free directions of each operation, (6 n, f_k), orthonormal in the block of that operation.

    The other blocks are the smallest motion, in standard deviations, with which later operations adapt. Earlier
    operations stay fixed.
    """
    left = known.free
    for k in range(n):
        if not left.shape[1]:
            yield left
            continue
        _, w, Vt = np.linalg.svd(left[6 * k : 6 * k + 6], full_matrices=True)
        count = int(np.count_nonzero(w > _ZERO))
        yield left @ (Vt[:count].T / w[:count])
        left = left @ Vt[count:].T  # what remains free once operation k is fixed


def _along(k: int, own: Array, B: Array, direction: Direction) -> tuple[int, ...]:
    """The later operations that must move if operation k moves in one of its free directions.

    Args:
        own: Its free directions, as `_own_directions` yields them.
        B: (6, 6), the body twist at its pose per unit of z.
    """
    # The twist as a combination of the operation's own free directions, which take later operations along.
    share = np.linalg.lstsq(B @ own[6 * k : 6 * k + 6], direction.twist, rcond=None)[0]
    moved = np.linalg.norm((own @ share).reshape(-1, 6), axis=1)
    return tuple(int(j) for j in np.flatnonzero(moved > 1e-6 * moved[k]) if j > k)


def _standing(assembly: Assembly, start: Poses, poses: Array, B: Array, spans: Array) -> tuple[PartExplanation, ...]:
    """The explanation of every moved part at the end; its pose is a product of poses, so errors of all of them add up.

    Args:
        B: (n, 6, 6), the body twist of each pose per unit of z.
        spans: (n, 6, f), factor of the joint posterior covariance of the body twists.
    """
    if not len(assembly):
        return ()
    final = compute_placements(assembly, start, poses)[-1]
    last = assembly.odls()[-1]
    # The ODLs at the end, in which one operation per part that puts it at its start comes first.
    words = dict(replace(assembly, operations=(*map(Operation, assembly.solids), *assembly.operations)).odls()[-1])
    stack = np.concatenate([np.array([start[part] for part in assembly.solids]), poses])
    explained = []
    for part in last:
        # The twist of the part is a sum over poses, so its factor `moved` is the sum over all poses. `unit` is the
        # standard deviation of each component as observed: directions are told from rounding in that unit.
        reach = _reach(words[part], stack, len(assembly.solids), len(poses))
        moved = reach.reshape(6, -1) @ spans.reshape(reach[0].size, -1)
        unit = np.sqrt(np.square(np.swapaxes(reach, 0, 1) @ B).sum(axis=(0, 2)))[:, None]
        U, w, _ = np.linalg.svd(moved / unit, full_matrices=False)
        C = moved @ moved.T
        named = directions(unit * U[:, w > _ZERO])
        loose = tuple(FreeDirection(d, _deviation(C, d)) for d in named)
        placing = max(k for k, operation in enumerate(assembly.operations) if part in operation.moves)
        explained.append(PartExplanation(part, placing, last[part], final[part], 6 - len(loose), held(named), loose, C))
    return tuple(sorted(explained, key=lambda one: one.placed))


def _reach(word: ODL, stack: Array, constants: int, n: int) -> Array:
    """The derivative of the body twist of a product of poses by the body twist of each pose, (6, n, 6).

    T exp(xi) M = T M exp(Ad(M^-1) xi), and (T exp(xi))^-1 M = T^-1 M exp(-Ad(M^-1 T) xi).

    Args:
        word: The product.
        stack: The poses, (constants + n, 4, 4): start poses, then those of operations.
    """
    behind = np.eye(4)
    reach = np.zeros((n, 6, 6))
    for k, inverse in reversed(word):
        behind = pose.inverse(stack[k]) @ behind if inverse else behind
        if k >= constants:
            reach[k - constants] += (-1.0 if inverse else 1.0) * pose.adjoint(pose.inverse(behind))
        behind = behind if inverse else stack[k] @ behind
    return np.swapaxes(reach, 0, 1)
