"""Execute the moves of a plan one after the other, with probing, slip records and the cache of states."""

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
"""Time that the arm stands still before the first operation."""


def moves_with_error(plan: Plan, scene: Scene, config: ExecutionConfig, error: RobotError | None) -> tuple[Move, ...]:
    """Return the moves of a plan with the poses to which a robot with errors really goes.

    Args:
        error: Hand-eye and tool error enter here; joint errors are part of the simulated robot. None: no error.
    """
    probes = config.probing is not None
    if error is None:
        return plan_moves(plan, scene, config.searches, probes)
    planned = plan_moves(error.plan(plan), scene, config.searches, probes)
    return tuple(Move(step, transfer.with_tip_at(error.pads)) for step, transfer in planned)


def failed_outcome(plan: Plan, stage: str, code: str, k: int, part: str = "") -> Outcome:
    """Return the outcome of a failed operation.

    Args:
        stage: Where it failed, such as `pick` or `plan`.
        code: The failure code.
        k: The operation, counted from 0.
        part: The part that the description names; by default the main part of the operation.
    """
    return Outcome(stage, code, k, describe_outcome(code, part=part or plan.assembly.operations[k].main, operation=k))


class Execution:
    """One robot that executes one plan, with its progress and its calibration by probing."""

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
        """The errors of the robot that remain after its commands compensate for the estimated ones; None: no errors."""
        return self.config.robot_error if self.probing is None else self.probing.residual

    def moves(self) -> tuple[Move, ...]:
        """Return the moves of the plan with the errors that remain by the present calibration estimate."""
        return moves_with_error(self.plan, self.robot.scene, self.config, self.residual)

    def run(self, todo: tuple[Move, ...], cache: ReplayCache, keys: Sequence[bytes]) -> Outcome:
        """Execute moves one after the other, starting from the furthest state in the cache.

        Args:
            todo: The first moves of the schedule; planned again after probing.
            cache: Saved states of earlier replays, to which this one adds.
            keys: Cache keys of `todo`, two for each move: after it is picked, and after it is done.

        Returns:
            The outcome of the first failure, or success.
        """
        robot = self.robot
        # Two states are kept for each move, so `kept_states // 2` moves are done already.
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
                    if kept_states <= 2 * i:  # else the restored state already holds this part
                        grip = self.pick(transfer, step.operation)
                        cache.keep(keys[2 * i], robot, grip, self.progress)
                    place(robot, transfer, grip, self.laying(transfer, step.operation))
                    self._note_slip(step)
                    wait_for_rest(robot)
                    reached = None if step.undo else take_snapshot(robot.scene.work, robot.data, self.plan.start)
            except ExecutionAborted as aborted:
                if aborted.code != "unstable_simulation":
                    self._note_slip(step)
                if aborted.code == "force_stop" and not step.undo:  # the part is placed, but not at its goal
                    self.progress.after[step.operation] = take_snapshot(robot.scene.work, robot.data, self.plan.start)
                return failed_outcome(self.plan, aborted.stage, aborted.code, step.operation, aborted.part)
            self.progress.after[step.operation] = reached
            self.progress.timeline.append((step, float(robot.data.time)))
            cache.keep(keys[2 * i + 1], robot, 0, self.progress)
            robot.hooks.after_step(step)
        return Outcome("done", "ok", None, describe_outcome("ok"))

    def pick(self, transfer: Transfer, operation: int) -> int:
        """Pick the part of an operation and apply the slip that was drawn for it.

        Returns:
            Index into `transfer.grips` of the grip in use.

        Raises:
            ExecutionAborted: Something went wrong.
        """
        grip = pick(self.robot, transfer, again=self.probing is not None)
        self.robot.slip(operation)
        return grip

    def laying(self, transfer: Transfer, operation: int) -> Callable[[Transfer, Grip], Grip] | None:
        """Return the function that lays the picked part flat before it is inserted; None if this is not planned.

        With probing, the grasp is also added to the calibration estimate.
        """
        if self.probing is None:
            return None
        self.probing.note_grasp(operation)
        return None if transfer.flat is None else partial(lay_flat, self.robot, self.probing, operation)

    def _begin(self, todo: tuple[Move, ...]) -> tuple[Move, ...]:
        """Stand still, and probe if configured; return the moves, planned again by the updated calibration."""
        self.robot.wait(_AT_FIRST_S)
        self.robot.level()
        if self.probing is None:
            return todo
        probe_fixed_parts(self.robot, self.probing)
        return self.moves()[: len(todo)]

    def _note_slip(self, step: Step) -> None:
        """Add the slip in the hand during a step to the records; steps that undo an operation have none."""
        monitor = self.robot.slip_monitor
        if monitor.grasped is not None:  # aborted with the part in the hand
            monitor = monitor.release(self.robot.in_hand())
        undone = GraspSlipMonitor(finished=monitor.finished)
        self.robot.slip_monitor = undone if step.undo else monitor.finish(step.operation)
