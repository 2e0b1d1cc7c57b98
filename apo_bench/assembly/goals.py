"""The numbers that flow, under different names by role, so that a plan cannot be mixed up with the truth.

Goals are one pose per operation, shape (n, 4, 4), world frame, [m]. Parts that start somewhere known have a
`start` pose; for a fixed part that is where it stays. From both follows where every part stands after each operation.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench.arguments import check_arguments
from apo_bench.assembly.error_models import OutlierModel, SharedError, Tails
from apo_bench.assembly.topology import Assembly
from apo_bench.errors import ArgumentError, require, require_known
from apo_bench.geometry import Array, copyable, freeze, pose

Poses = Mapping[str, Array]
"""Part name -> pose (4, 4) in the world, [m]."""
SCHEDULE_REMEDY = "do operations in order, undo the last one that is done, and have everything done at the end"


@final
@check_arguments
@copyable
@dataclass(frozen=True, eq=False)
class Layout:
    """The truth of a trial: the consistent goals a seed draws, before any human error."""

    poses: Array
    start: Poses

    def __post_init__(self) -> None:
        freeze(self, poses=(None, 4, 4), start=(4, 4))


@final
@check_arguments
@copyable
@dataclass(frozen=True, eq=False)
class Demonstration:
    """What the human did, without measurement error."""

    assembly: Assembly
    start: Poses
    poses: Array
    """(n, 4, 4): pose of each operation's main part when the hand had let go of it and it rested."""
    final: Poses
    """Where every part lay at the end: small late adjustments show here and nowhere else."""
    human_error_covariance: Array
    """(n, 6, 6) covariance [m, rad] that the human's carelessness adds, body frame of each main part."""
    code: str = "ok"
    """`ok`, or `demonstration_failed`."""
    why: str = ""
    """What the judge found wrong, in words."""
    gap_m: float = 1e-4
    """Largest |e| at which the contact equations count as solved, [m]; what observes it passes it on."""
    play_m: float = 0.0
    """Clearance per side of the parts that fit, [m]; what observes it passes it on."""

    def __post_init__(self) -> None:
        n = len(self.assembly)
        freeze(self, poses=(n, 4, 4), human_error_covariance=(n, 6, 6), start=(4, 4), final=(4, 4))
        _check_parts(self.assembly, self.start, self.final)


@final
@check_arguments
@copyable
@dataclass(frozen=True, eq=False)
class Observation:
    """What was seen: all a corrector may use."""

    assembly: Assembly
    start: Poses
    poses: Array
    """(n, 4, 4)."""
    covariance: Array
    """(n, 6, 6), of the body twist by which each goal is wrong, [m, rad]."""
    observed: NDArray[np.bool_]
    """(n,): whether the operation was seen at all."""
    gap_m: float = 1e-4
    """Largest |e| at which the contact equations count as solved, [m]."""
    play_m: float = 0.0
    """How far from nominal a contact of parts that fit may really be: their clearance per side, [m]."""
    outliers: OutlierModel | None = None
    """How often observations of this kind are worse than they say; None if that is not known."""
    shared: tuple[SharedError, ...] = ()
    """What errors of operations have in common, all of it within `covariance`; none: they are independent."""
    tails: Tails | None = None
    """How errors are distributed; None: as a Gaussian's."""

    def __post_init__(self) -> None:
        n = len(self.assembly)
        freeze(self, poses=(n, 4, 4), covariance=(n, 6, 6), start=(4, 4))
        _check_parts(self.assembly, self.start)
        object.__setattr__(self, "shared", tuple(self.shared))
        for error in self.shared:
            if max(error.operations, default=-1) >= n:
                raise ArgumentError(
                    f"the shared error '{error.name}' names operation {max(error.operations) + 1} of {n}"
                )
        if self.tails is not None and len(self.tails.frames) != n:
            raise ArgumentError(f"tails of {len(self.tails.frames)} operations were given for {n}")
        observed = np.array(self.observed, dtype=np.bool_)
        if observed.shape != (n,):
            raise ArgumentError(f"`observed` needs shape ({n},), {observed.shape} was given")
        observed.flags.writeable = False
        object.__setattr__(self, "observed", observed)

    def plan(self) -> "Plan":
        """What was seen, as it is: the plan of the method `uncorrected`.

        Raises:
            InputError: An operation was not seen.
        """
        require(
            self.observed.all(),
            f"operation {int(np.argmin(self.observed)) + 1} was not seen, so the observation cannot be replayed as is; "
            "observe the demonstration again.",
        )
        return Plan(self.assembly, self.start, self.poses)


def _check_parts(assembly: Assembly, *placed: Poses) -> None:
    """Raise an `InputError` if poses are of a part that the assembly does not have."""
    for part in {part: None for poses in placed for part in poses}:
        require_known("part in the poses", part, assembly.solids)


class Step(NamedTuple):
    """One entry of a schedule: do an operation (counted from 0), or undo it."""

    operation: int
    undo: bool = False


def once_each(n: int) -> tuple[Step, ...]:
    """The plain schedule: every operation once, in order."""
    return tuple(Step(k) for k in range(n))


@final
@check_arguments
@copyable
@dataclass(frozen=True, eq=False)
class Plan:
    """What the robot is asked to do."""

    assembly: Assembly
    start: Poses
    target_poses: Array
    """(n, 4, 4): where every operation puts its main part in the end."""
    schedule: tuple[Step, ...] = field(default=())
    """Empty stands for: every operation once, in order."""
    step_poses: Array = field(default_factory=lambda: np.zeros((0, 4, 4)))
    """(steps, 4, 4): the motion parameter that was in force at each step of the schedule; of an undo step, the one
    that it undoes. Empty stands for: those of `target_poses`."""

    def __post_init__(self) -> None:
        n = len(self.assembly)
        freeze(self, target_poses=(n, 4, 4), start=(4, 4))
        _check_parts(self.assembly, self.start)
        if not self.schedule:
            object.__setattr__(self, "schedule", once_each(n))
        if not len(self.step_poses):
            object.__setattr__(self, "step_poses", self.target_poses[[step.operation for step in self.schedule]])
        freeze(self, step_poses=(len(self.schedule), 4, 4))

    @check_arguments
    def with_target_poses(self, poses: Array) -> "Plan":
        """The plan with other target poses, (n, 4, 4), also in the steps that bring parts to the old ones."""
        done = [step.operation for step in self.schedule]
        # step poses that are not target poses are states in between, which stay where they are
        final = (self.step_poses == self.target_poses[done]).all(axis=(1, 2))
        return replace(
            self, target_poses=poses, step_poses=np.where(final[:, None, None], poses[done], self.step_poses)
        )


def placements(assembly: Assembly, start: Poses, goals: Array) -> tuple[Poses, ...]:
    """The pose of every part after each operation, what an ODL stands for (Section 3.2.1), by walking the operations.

    Args:
        start: Poses before the first operation, world frame, [m].
        goals: (n, 4, 4), world frame, [m].

    Returns:
        One mapping per operation; a part that was not moved yet stands where it started.
    """
    history: list[Poses] = []
    now = dict(start)
    for operation, goal in zip(assembly.operations, goals, strict=True):
        before = now[operation.main]
        now = dict(now)
        # What is carried keeps its place on the main part: T_world_carried = T_goal T_before^-1 T_world_carried.
        for part in operation.carries:
            now[part] = goal @ pose.inverse(before) @ now[part]
        now[operation.main] = goal
        history.append(MappingProxyType(now))
    return tuple(history)


def schedule_fault(schedule: Sequence[Step], operations: int) -> str:
    """What is wrong with it, such as `undoes operation 2, which is not done`; empty if nothing is.

    What is done is always the first few operations: an operation may stand on all that came before it, and what was
    undone last first leaves free the place that it came from.
    """
    done = 0
    for k, undo in schedule:
        faults = {
            f"names operation {k + 1}, where {operations} are known": not 0 <= k < operations,
            f"undoes operation {k + 1}, which is not done": undo and k >= done,
            f"undoes operation {k + 1} before operation {done}, which came after it": undo and k < done - 1,
            f"does operation {k + 1} again, which is done": not undo and k < done,
            f"does operation {k + 1} before operation {done + 1}": not undo and k > done,
        }
        if any(faults.values()):
            return next(fault for fault, is_one in faults.items() if is_one)
        done += -1 if undo else 1
    return f"leaves operation {done + 1} undone" if done < operations else ""


def goals_in_force(plan: Plan) -> list[tuple[int, Array]]:
    """How many operations are done, and the goals in force, before each time something is undone and at the end."""
    goals = np.array(plan.target_poses)
    done = 0
    stages = []
    for i, (step, target) in enumerate(zip(plan.schedule, plan.step_poses, strict=True)):
        if not step.undo:
            goals[step.operation] = target
            done = step.operation + 1
        if i + 1 == len(plan.schedule) or (plan.schedule[i + 1].undo and not step.undo):
            stages.append((done, np.array(goals)))
    return stages
