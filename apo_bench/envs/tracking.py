"""Policies of `APOTrack-v0` (Section 4.2 of the paper): which operations to do, undo and do again."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import Observation, ReachedState, Snapshot, compute_placements, project_observation
from apo_bench.correction.baselines.track import nested, next_operation, reached_back
from apo_bench.correction.correctors import correct
from apo_bench.correction.solvers import LENGTH_M
from apo_bench.geometry import Array, pose


@final
@dataclass(frozen=True, eq=False)
class Tracked:
    """The operations shown to the robot, of which it has done all but the last."""

    observation: Observation
    """The observation of the m operations shown."""
    placed: Array
    """(m, 4, 4): poses at which operations were done, and the observed pose of the last one; world, [m]."""


@final
class TrackingAction(NamedTuple):
    """An act of the robot: do the next operation, or undo the last one that is done."""

    undo: bool
    target: Array
    """(4, 4), world, [m]: target pose of the main part to do; present pose of the part to undo."""


Policy = Callable[[Tracked], tuple[TrackingAction, ...]]
"""Returns the acts until the last operation shown is done; without any act the policy gives up."""


def paper_track_policy(known: Tracked) -> tuple[TrackingAction, ...]:
    """Act as the corrector `paper-track`: free the most recent candidate operations until every contact holds."""
    seen = project_observation(known.observation)
    if not seen.observed.all():
        return ()
    step = next_operation(seen, known.placed, nested)
    return _acts(known, step.poses, step.freed) if step.status == "converged" else ()


def contact_policy(known: Tracked) -> tuple[TrackingAction, ...]:
    """Correct all observed operations by `contact`, and redo those that this moves by more than the allowed gap."""
    correction = correct(known.observation, "contact")
    if not correction.ok:
        return ()
    # of all but the last, as translation and rotation
    off = pose.log(pose.inverse(known.placed) @ correction.poses)[:-1].reshape(-1, 2, 3)
    m = np.linalg.norm(off, axis=2) @ [1.0, LENGTH_M]  # a rotation counts as the shift at the distance LENGTH_M
    return _acts(known, correction.poses, np.flatnonzero(m > known.observation.gap_m).tolist())


def _acts(known: Tracked, goals: Array, freed: list[int] | tuple[int, ...]) -> tuple[TrackingAction, ...]:
    """Return the acts that undo operations back to the first of `freed`, and do all up to the last one shown."""
    return tuple(
        TrackingAction(undo, (known.placed if undo else goals)[k]) for k, undo in reached_back(len(goals) - 1, freed)
    )


def observe_first(observation: Observation, m: int) -> Observation:
    """Return the observation of the first m operations, with the shared errors that concern them."""
    shared = []
    for error in observation.shared:
        kept = [i for i, k in enumerate(error.operations) if k < m]  # positions in the error's list of operations
        few = None if error.correlation is None else error.correlation[np.ix_(kept, kept)]
        if kept:
            shared.append(replace(error, operations=tuple(error.operations[i] for i in kept), correlation=few))
    tails = observation.tails
    return replace(
        observation,
        assembly=observation.assembly.first(m),
        poses=observation.poses[:m],
        covariance=observation.covariance[:m],
        observed=observation.observed[:m],
        shared=tuple(shared),
        tails=None if tails is None else replace(tails, frames=tails.frames[:m]),
    )


def reach_exactly(observation: Observation, poses: Array) -> ReachedState:
    """Return the state in which every part rests exactly at its pose, released; poses are (n, 4, 4), world, [m]."""
    stages = compute_placements(observation.assembly, observation.start, poses)
    after = tuple(Snapshot(poses, 0.0, 0.0, 0.0, True) for poses in stages)
    return ReachedState(after, after[-1] if after else Snapshot(observation.start, 0.0, 0.0, 0.0, True))
