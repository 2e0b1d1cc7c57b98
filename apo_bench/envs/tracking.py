"""Policies of `APOTrack-v0` (Section 4.2 of the paper)."""

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
    """Of m operations."""
    placed: Array
    """(m, 4, 4): the poses at which operations were done, and the observed pose of the last one; world frame, [m]."""


@final
class TrackingAction(NamedTuple):
    """Do the next operation, or undo the last one that is done."""

    undo: bool
    target: Array
    """(4, 4): target pose of its main part, or the present pose; world frame, [m]."""


Policy = Callable[[Tracked], tuple[TrackingAction, ...]]
"""The acts until the last operation shown is done; no act gives up."""


def paper_track_policy(known: Tracked) -> tuple[TrackingAction, ...]:
    """The corrector `paper-track`, act by act: free the most recent candidates until every contact holds."""
    seen = project_observation(known.observation)
    if not seen.observed.all():
        return ()
    step = next_operation(seen, known.placed, nested)
    return _acts(known, step.poses, step.freed) if step.status == "converged" else ()


def contact_policy(known: Tracked) -> tuple[TrackingAction, ...]:
    """Correct all observed operations by `contact`; redo those that it moves by more than the gap."""
    correction = correct(known.observation, "contact")
    if not correction.ok:
        return ()
    off = pose.log(pose.inverse(known.placed) @ correction.poses)[:-1].reshape(-1, 2, 3)
    m = np.linalg.norm(off, axis=2) @ [1.0, LENGTH_M]
    return _acts(known, correction.poses, np.flatnonzero(m > known.observation.gap_m).tolist())


def _acts(known: Tracked, goals: Array, freed: list[int] | tuple[int, ...]) -> tuple[TrackingAction, ...]:
    return tuple(
        TrackingAction(undo, (known.placed if undo else goals)[k]) for k, undo in reached_back(len(goals) - 1, freed)
    )


def observe_first(observation: Observation, m: int) -> Observation:
    """The observation of the first m operations."""
    shared = []
    for error in observation.shared:
        kept = [i for i, k in enumerate(error.operations) if k < m]
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
    """The state in which every part rests exactly at its pose, (n, 4, 4), released."""
    stages = compute_placements(observation.assembly, observation.start, poses)
    after = tuple(Snapshot(poses, 0.0, 0.0, 0.0, True) for poses in stages)
    return ReachedState(after, after[-1] if after else Snapshot(observation.start, 0.0, 0.0, 0.0, True))
