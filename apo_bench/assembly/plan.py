"""Plan of the robot: target poses, and the order in which operations are done and undone."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple, final

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly.poses import Poses, check_parts
from apo_bench.assembly.topology import Assembly
from apo_bench.geometry import Array, freeze, make_copyable

SCHEDULE_REMEDY = "do operations in order, undo the last one that is done, and have everything done at the end"
"""The remedy in error messages about schedules."""


class Step(NamedTuple):
    """One entry of a schedule: do an operation (counted from 0), or undo it."""

    operation: int
    undo: bool = False


@final
@check_arguments
@make_copyable
@dataclass(frozen=True, eq=False)
class Plan:
    """The target poses of n operations, and the order in which the robot does and undoes them."""

    assembly: Assembly
    """Solids, operations and contacts, without poses."""
    start: Poses
    """Part -> its pose before the first operation, (4, 4), world frame, [m]."""
    target_poses: Array
    """(n, 4, 4): the final pose of the main part of each operation, world frame, [m]."""
    schedule: tuple[Step, ...] = field(default=())
    """Operations to do or undo, in order. Default: every operation once."""
    step_poses: Array = field(default_factory=lambda: np.zeros((0, 4, 4)))
    """(steps, 4, 4): the target of each step of the schedule, world frame, [m]; of an undo step, the target that it
    undoes. Default: those of `target_poses`."""

    def __post_init__(self) -> None:
        n = len(self.assembly)
        freeze(self, target_poses=(n, 4, 4), start=(4, 4))
        check_parts(self.assembly, self.start)
        if not self.schedule:
            object.__setattr__(self, "schedule", tuple(map(Step, range(n))))
        if not len(self.step_poses):
            object.__setattr__(self, "step_poses", self.target_poses[[step.operation for step in self.schedule]])
        freeze(self, step_poses=(len(self.schedule), 4, 4))

    @check_arguments
    def with_target_poses(self, poses: Array) -> "Plan":
        """Return the plan with other target poses, (n, 4, 4), world frame, [m]; steps to the old ones lead to them."""
        done = [step.operation for step in self.schedule]
        # step poses that are not target poses are states in between, which stay where they are
        final = (self.step_poses == self.target_poses[done]).all(axis=(1, 2))
        return replace(
            self, target_poses=poses, step_poses=np.where(final[:, None, None], poses[done], self.step_poses)
        )


def find_schedule_fault(schedule: Sequence[Step], operations: int) -> str:
    """The fault of a schedule in words, such as `undoes operation 2, which is not done`; empty if there is none.

    The operations that are done are always the first few. An operation may rest on all earlier ones, so only the last
    one that is done may be undone.
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


def list_poses_between_undos(plan: Plan) -> list[tuple[int, Array]]:
    """The number of operations done, and target poses, (n, 4, 4), before each run of undo steps and at the end."""
    poses = np.array(plan.target_poses)
    done = 0
    stages = []
    for i, (step, target) in enumerate(zip(plan.schedule, plan.step_poses, strict=True)):
        if not step.undo:
            poses[step.operation] = target
            done = step.operation + 1
        if i + 1 == len(plan.schedule) or (plan.schedule[i + 1].undo and not step.undo):
            stages.append((done, np.array(poses)))
    return stages
