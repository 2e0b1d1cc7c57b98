"""Prepare the start of an episode, at which the robot holds the part before its hole.

A start is a state of the physics and what the robot knows; made once, it is restored as often as wanted.
"""

from dataclasses import dataclass, replace
from typing import final

import numpy as np

from apo_bench.assembly import Outcome, Plan, Poses, Snapshot
from apo_bench.geometry import Array, pose
from apo_bench.planning.insertion.surroundings import WALL_MARGIN_M
from apo_bench.records import describe_outcome
from apo_bench.simulation.execution import (
    Execution,
    ExecutionConfig,
    Grip,
    Move,
    ReplayCache,
    SavedState,
    Transfer,
    carry_to_attach,
    restore_state,
    save_state,
)
from apo_bench.simulation.hooks import Hooks
from apo_bench.simulation.robot import (
    ExecutionAborted,
    Robot,
    RobotError,
    WristSensor,
    compute_part_loads,
    get_wrist,
    zero,
)
from apo_bench.simulation.scene import Scene, allow_sleep


@final
@dataclass(frozen=True, eq=False)
class Start:
    """One start; nothing changes it."""

    operation: int
    """Counted from 0."""
    parts: Poses
    """Where the parts stood at first."""
    transfer: Transfer
    """With the errors of the robot in its poses: where the robot really goes."""
    grip: Grip
    second: Grip | None
    """The grip after the guarded motion, if it is changed then."""
    direction: Array
    """The insertion axis by the robot's own estimate, unit vector, (3,), world."""
    off: Array
    """(joints,), by how much each joint is off its encoder, [rad]."""
    saved: SavedState
    wrist: WristSensor
    """Zeroed here."""
    after: tuple[Snapshot | None, ...]
    """After each operation before."""


def prepare_start(
    plan: Plan, scene: Scene, k: int, config: ExecutionConfig, sensor: tuple[str, tuple[int, ...]]
) -> Start | Outcome:
    """Execute a plan up to where the guarded motion of an operation begins; or return what failed before.

    Args:
        k: The operation, counted from 0; the last time that it is done.
        config: How the robot executes it; it skips free motions and searches for holes anyway.
        sensor: The force-torque sensor at the wrist, by name, and the seed of its noise.
    """
    at = max(i for i, step in enumerate(plan.schedule) if step.operation == k and not step.undo)
    config = replace(config, fidelity="near-contact", spiral=True)
    robot = Robot(scene, plan.start, Hooks(), config.fidelity, config.robot_error)
    execution = Execution(plan, robot, config)
    with allow_sleep(scene.work, scene.grasp == "friction"):
        outcome = execution.run(execution.moves()[:at], ReplayCache(), [b"%d" % i for i in range(2 * at)])
        if outcome.failed:
            return outcome
        return _hold(execution, execution.moves()[at], sensor)


def prepare_next_start(
    plan: Plan,
    robot: Robot,
    start: Start,
    reached: Snapshot,
    error: RobotError | None,
    sensor: tuple[str, tuple[int, ...]],
) -> Start | Outcome:
    """The start of the next operation, by the robot that has just released a part; as `prepare_start`, without probing.

    Args:
        robot: As an agent has moved it from `start`; it is left as it is.
        reached: What it has reached.
    """
    config = ExecutionConfig("near-contact", spiral=True, robot_error=error)
    execution = Execution(plan, Robot(robot.scene, start.parts, Hooks(), config.fidelity, error), config)
    execution.progress.after[:] = [*start.after, reached]
    with allow_sleep(robot.scene.work, robot.scene.grasp == "friction"):
        restore_state(save_state(robot, 0, execution.progress), execution.robot)
        return _hold(execution, execution.moves()[start.operation + 1], sensor)


def _hold(execution: Execution, move: Move, sensor: tuple[str, tuple[int, ...]]) -> Start | Outcome:
    """Pick the part of a move and hold it before its hole."""
    robot = execution.robot
    robot.step, t = move
    k = robot.step.operation
    if not t.into.level and t.entrances:
        t = replace(t, in_last=True, slow=max(t.slow, max(t.entrances) + WALL_MARGIN_M))
    try:
        with robot.watch_stability():
            i = execution.pick(t, k)
            grip, second = carry_to_attach(robot, t, i, execution.laying(t, k))
            wrist = get_wrist(robot, sensor[0], np.random.default_rng(sensor[1]))
            wrist.hold(*compute_part_loads(robot.scene, {t.part: pose.inverse(grip.T_part_tip)}))
            zero(robot, wrist)
    except ExecutionAborted as aborted:
        return Outcome(
            aborted.stage, aborted.code, k, describe_outcome(aborted.code, part=aborted.part or t.part, operation=k)
        )
    left = execution.residual
    return Start(
        operation=k,
        parts=dict(execution.plan.start),
        transfer=t,
        grip=grip,
        second=second,
        direction=t.into.direction if left is None else left.hand_eye[:3, :3].T @ t.into.direction,
        off=np.zeros(len(robot.scene.arm.joints)) if left is None else left.joints,
        saved=save_state(robot, i, execution.progress),
        wrist=wrist.at(np.zeros(len(robot.data.sensordata)), _no_encoders, np.random.default_rng(0)),
        after=tuple(execution.progress.after[:k]),
    )


def _no_encoders() -> Array:
    """The encoders of no robot."""
    return np.zeros(0)
