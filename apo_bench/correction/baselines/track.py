"""The corrector `paper-track` (Section 4.2): correct after each observed operation, reaching back as far as necessary.

The robot has done operations 1 .. n-1 with the current poses when it observes operation n. If the contacts of that
operation do not hold, the k most recent candidates are freed, k = 1, 2, .., until they do. Then the robot disassembles
back to the oldest of them and assembles again. The result is a schedule of do and undo steps.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import (
    Correction,
    Equations,
    FreeingTrial,
    Iterate,
    Observation,
    Step,
    build_contact_equations,
    find_largest_residual,
)
from apo_bench.correction.baselines.candidates import candidates
from apo_bench.correction.baselines.own_contacts import solve_own_contacts
from apo_bench.correction.checks.status import refuse_correction, solver_status, status_sentence
from apo_bench.correction.solvers import Solution, solve_newton
from apo_bench.geometry import Array

_Sets = Callable[[tuple[int, ...]], Iterable[tuple[int, ...]]]
"""Candidates, most recent first -> the sets of motion parameters to try, in order."""


def paper_track(observation: Observation) -> Correction:
    """Correct step by step, freeing the 1, 2, .. most recent candidates.

    Returns:
        As `paper`; `freed` is what successful trials changed, `tried` every trial, rank and trace those of the last
        one. If no set of candidates suffices, the steps before keep their corrected poses and there is no schedule.
    """
    return track_operations(observation, nested)


def nested(chosen: tuple[int, ...]) -> Iterable[tuple[int, ...]]:
    """The sets of the 1, 2, .. most recent candidates."""
    return (chosen[:k] for k in range(1, len(chosen) + 1))


@final
@dataclass(frozen=True, eq=False)
class TrackedOperation:
    """The result of the correction after one more operation."""

    poses: Array
    """(n + 1, 4, 4): the new poses; unchanged if no set sufficed."""
    status: str
    freed: tuple[int, ...] = ()
    tried: tuple[FreeingTrial, ...] = ()
    rank: int = 0
    trace: tuple[Iterate, ...] = ()


def track_operations(observation: Observation, sets: _Sets) -> Correction:
    """Correct after every operation in turn, trying the sets of candidates that `sets` returns."""
    if not observation.observed.all():
        return refuse_correction(observation)
    now = np.array(observation.poses)
    schedule = list[Step]()
    targets = list[Array]()
    steps = list[TrackedOperation]()
    for n in range(len(now)):
        steps.append(next_operation(observation, now[: n + 1], sets))
        if steps[-1].status != "converged":
            return _report(observation, now, steps)
        back = reached_back(n, steps[-1].freed)
        targets += [now[step.operation] if step.undo else steps[-1].poses[step.operation] for step in back]
        schedule += back
        now = np.concatenate([steps[-1].poses, now[n + 1 :]])
    return _report(observation, now, steps, tuple(schedule), np.array(targets) if targets else None)


def reached_back(n: int, freed: Iterable[int]) -> list[Step]:
    """The steps after operation n was observed: undo n-1 .. i, then do i .. n, with i the oldest freed operation.

    Nothing is undone if none was freed, or i is n itself.
    """
    i = min(freed, default=n)
    return [Step(k, undo=True) for k in reversed(range(i, n))] + [Step(k) for k in range(i, n + 1)]


def next_operation(observation: Observation, poses: Array, sets: _Sets) -> TrackedOperation:
    """Correct after one more operation: the last of these poses was just observed, the others are current."""
    n = len(poses) - 1
    system = build_contact_equations(observation.assembly.first(n + 1), observation.start, poses)
    failing = ~(system.gaps(poses) <= observation.gap_m)
    if not failing[system.made == n].any():
        return TrackedOperation(solve_own_contacts(system, poses, n, observation.gap_m), "converged")
    chosen = candidates(observation.assembly.first(n + 1), failing)
    tried = list[FreeingTrial]()
    last = None
    for free in sets(chosen):
        last, left_m = _trial(system, poses, free, failing)
        if not last.finite:
            break
        tried.append(FreeingTrial(n, free, left_m))
        if left_m <= observation.gap_m:
            return TrackedOperation(last.poses, "converged", free, tuple(tried), last.rank, last.trace)
    status = "inconsistent" if last is None else solver_status(last, np.inf, observation.gap_m)
    return TrackedOperation(poses, status, (), tuple(tried), last.rank if last else 0, last.trace if last else ())


def _trial(
    system: Equations, poses: Array, free: tuple[int, ...], failing: NDArray[np.bool_]
) -> tuple[Solution, float]:
    """Solve all equations that contain a free motion parameter.

    Returns:
        The solution, and the largest |e| of these equations and of contacts that had failed, [m].
    """
    chosen = system.contacts_with(free)
    solution = solve_newton(system.among(chosen), poses, free)
    return solution, find_largest_residual(system.gaps(solution.poses)[chosen | failing])


def _report(
    observation: Observation,
    poses: Array,
    steps: list[TrackedOperation],
    schedule: tuple[Step, ...] = (),
    targets: Array | None = None,
) -> Correction:
    """The correction of the whole demonstration."""
    system = build_contact_equations(observation.assembly, observation.start, observation.poses)
    status = steps[-1].status if steps else "converged"
    last = next((step for step in reversed(steps) if step.trace), TrackedOperation(poses, status))
    return Correction(
        poses=poses,
        status=status,
        sentence=status_sentence(status, observation.gap_m),
        freed=tuple(sorted({k for step in steps for k in step.freed}, reverse=True)),
        gap_before_m=find_largest_residual(system.gaps(observation.poses)),
        gap_after_m=find_largest_residual(system.gaps(poses)),
        rank=last.rank,
        trace=last.trace,
        tried=tuple(one for step in steps for one in step.tried),
        schedule=schedule,
        step_poses=targets,
    )
