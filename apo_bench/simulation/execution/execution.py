"""Execute a schedule of moves by one robot."""

from collections.abc import Callable, Sequence
from functools import partial

from apo_bench.assembly import Outcome, Plan, Step
from apo_bench.records import describe_outcome, describe_touch
from apo_bench.simulation.execution.carry_out import pick, place
from apo_bench.simulation.execution.config import ExecutionConfig
from apo_bench.simulation.execution.prepare import Move, plan_moves
from apo_bench.simulation.execution.probing.lay_flat import lay_flat
from apo_bench.simulation.execution.probing.state import ProbingState
from apo_bench.simulation.execution.probing.touching import probe_fixed_parts
from apo_bench.simulation.execution.replay_cache import Progress, ReplayCache
from apo_bench.simulation.execution.resting import wait_for_rest
from apo_bench.simulation.execution.transfer import Grip, Transfer
from apo_bench.simulation.robot import ExecutionAborted, GraspSlipMonitor, Robot, RobotError
from apo_bench.simulation.scene import Scene, take_snapshot

_AT_FIRST_S = 0.05
"""The arm stands so long before the first operation."""


def moves_with_error(plan: Plan, scene: Scene, config: ExecutionConfig, error: RobotError | None) -> tuple[Move, ...]:
    """The moves of a plan as a robot with an error executes them."""
    if error is None:
        return plan_moves(plan, scene, config.searches, config.actions)
    planned = plan_moves(error.plan(plan), scene, config.searches, config.actions)
    return tuple(Move(step, transfer.with_tip_at(error.tool)) for step, transfer in planned)


def failed_outcome(plan: Plan, stage: str, code: str, k: int, part: str = "") -> Outcome:
    """The outcome of an operation that failed; by default about its main part."""
    return Outcome(stage, code, k, describe_outcome(code, part=part or plan.assembly.operations[k].main, operation=k))


class Execution:
    """One robot on its way through a schedule."""

    def __init__(self, plan: Plan, robot: Robot, config: ExecutionConfig) -> None:
        self.plan = plan
        self.robot = robot
        self.config = config
        self.progress = Progress([None] * len(plan.assembly), [])
        self.probing: ProbingState | None = None
        if config.probing is not None:
            self.probing = ProbingState(config.probing, plan, robot.scene, config.robot_error)

    @property
    def residual(self) -> RobotError | None:
        """The errors of the robot for which its commands do not compensate."""
        return self.config.robot_error if self.probing is None else self.probing.residual

    def moves(self) -> tuple[Move, ...]:
        """The moves of the plan by the present estimate of the robot's errors."""
        return moves_with_error(self.plan, self.robot.scene, self.config, self.residual)

    def run(self, todo: tuple[Move, ...], cache: ReplayCache, keys: Sequence[bytes]) -> Outcome:
        """Execute moves one after the other, from the furthest state in the cache.

        Args:
            todo: The first moves of the schedule; planned again once the robot has probed.
            keys: Those of `todo`, two for each move.
        """
        robot = self.robot
        kept_states, grip = cache.resume(keys, robot, self.progress)
        if not kept_states:
            try:
                with robot.watch_stability():
                    todo = self._begin(todo)
            except ExecutionAborted as aborted:
                if aborted.stage == "touch":
                    why = f": {aborted.why}" if aborted.why else ""
                    return Outcome("touch", aborted.code, None, describe_touch(aborted.code, part=aborted.part) + why)
                return failed_outcome(self.plan, "pick", aborted.code, self.plan.schedule[0].operation, aborted.part)
        for i, (step, transfer) in list(enumerate(todo))[kept_states // 2 :]:
            if robot.data.time > self.config.time_limit_s:
                return failed_outcome(self.plan, "pick", "time_limit", step.operation)
            robot.step = step
            robot.hooks.before_step(step)
            try:
                with robot.watch_stability():
                    if kept_states <= 2 * i:
                        grip = self.pick(transfer, step.operation)
                        cache.keep(keys[2 * i], robot, grip, self.progress)
                    place(robot, transfer, grip, self.laying(transfer, step.operation))
                    self._note_slip(step)
                    wait_for_rest(robot)
                    reached = None if step.undo else take_snapshot(robot.scene.work, robot.data, self.plan.start)
            except ExecutionAborted as aborted:
                if aborted.code != "unstable_simulation":
                    self._note_slip(step)
                if aborted.code == "force_stop" and not step.undo:
                    self.progress.after[step.operation] = take_snapshot(robot.scene.work, robot.data, self.plan.start)
                return failed_outcome(self.plan, aborted.stage, aborted.code, step.operation, aborted.part)
            self.progress.after[step.operation] = reached
            self.progress.timeline.append((step, float(robot.data.time)))
            cache.keep(keys[2 * i + 1], robot, 0, self.progress)
            robot.hooks.after_step(step)
        return Outcome("done", "ok", None, describe_outcome("ok"))

    def pick(self, transfer: Transfer, operation: int) -> int:
        """Pick a part, which may slip; returns which of the grips of the transfer is in use.

        Raises:
            ExecutionAborted: Something went wrong.
        """
        grip = pick(self.robot, transfer, again="square" in self.config.actions)
        self.robot.slip(operation)
        return grip

    def laying(self, transfer: Transfer, operation: int) -> Callable[[Transfer, Grip], Grip] | None:
        """How to lay the part flat that was picked, before it is inserted; None where that does not happen."""
        if self.probing is None:
            return None
        self.probing.note_grasp(operation)
        return None if transfer.flat is None else partial(lay_flat, self.robot, self.probing, operation)

    def _begin(self, todo: tuple[Move, ...]) -> tuple[Move, ...]:
        """Stand, and probe; returns the moves by what that showed."""
        self.robot.wait(_AT_FIRST_S)
        if self.probing is None:
            return todo
        probe_fixed_parts(self.robot, self.probing)
        return self.moves()[: len(todo)]

    def _note_slip(self, step: Step) -> None:
        """Record how the part moved in the hand; not of an operation that is undone."""
        monitor = self.robot.slip_monitor
        if monitor.grasped is not None:
            monitor = monitor.release(self.robot.in_hand())
        undone = GraspSlipMonitor(finished=monitor.finished)
        self.robot.slip_monitor = undone if step.undo else monitor.finish(step.operation)
