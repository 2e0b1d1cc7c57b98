"""Tracking (Section 4.2) as acts of a robot that follows a human: what it knows, and policies that say what to do.

A policy is asked whenever one more operation was seen, and says every act until it has done that one too.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import Observation, Reached, Snapshot, lowered_observation, placements
from apo_bench.correction.baselines.track import nested, next_operation, reached_back
from apo_bench.correction.correctors import correct
from apo_bench.correction.solvers import LENGTH_M
from apo_bench.geometry import Array, pose


@final
@dataclass(frozen=True, eq=False)
class Tracked:
    """What a robot knows that follows a human: m operations were seen, and it has done all of them but the last."""

    seen: Observation
    """Of m operations."""
    placed: Array
    """(m, 4, 4): the goals at which operations were done, and that of the last one as it was seen; world, [m]."""


@final
class Act(NamedTuple):
    """Do the next operation, or undo the last one that is done."""

    undo: bool
    target: Array
    """(4, 4): where its main part shall be, or is; world frame, [m]."""


Policy = Callable[[Tracked], tuple[Act, ...]]
"""The acts until the last operation that was seen is done; none gives up."""


def paper_track_policy(known: Tracked) -> tuple[Act, ...]:
    """Free the 1, 2, .. most recent candidates until every contact holds: the corrector `paper-track`, act by act."""
    seen = lowered_observation(known.seen)
    if not seen.observed.all():
        return ()
    step = next_operation(seen, known.placed, nested)
    return _acts(known, step.goals, step.freed) if step.status == "converged" else ()


def contact_policy(known: Tracked) -> tuple[Act, ...]:
    """Ask the corrector `contact` about all that was seen; redo what it puts elsewhere by more than the gap."""
    correction = correct(known.seen, "contact")
    if not correction.ok:
        return ()
    off = pose.log(pose.inverse(known.placed) @ correction.poses)[:-1].reshape(-1, 2, 3)
    m = np.linalg.norm(off, axis=2) @ [1.0, LENGTH_M]
    return _acts(known, correction.poses, np.flatnonzero(m > known.seen.gap_m).tolist())


def _acts(known: Tracked, goals: Array, freed: list[int] | tuple[int, ...]) -> tuple[Act, ...]:
    return tuple(Act(undo, (known.placed if undo else goals)[k]) for k, undo in reached_back(len(goals) - 1, freed))


def first_seen(observation: Observation, m: int) -> Observation:
    """What was seen of the first m operations."""
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


def exactly_at(observation: Observation, goals: Array) -> Reached:
    """What were reached if every part stood exactly at its goal, (n, 4, 4), at rest and let go of."""
    stages = placements(observation.assembly, observation.start, goals)
    after = tuple(Snapshot(poses, 0.0, 0.0, 0.0, True) for poses in stages)
    return Reached(after, after[-1] if after else Snapshot(observation.start, 0.0, 0.0, 0.0, True))
