"""Prepare the start of an episode, at which the robot holds the part before its hole.

A start contains the state of the physics and of the controller, so episodes can restore it any number of times.
"""

from dataclasses import dataclass, replace
from typing import final

import numpy as np

from apo_bench.assembly import Outcome, Plan, Poses, Snapshot
from apo_bench.geometry import Array, pose
from apo_bench.planning.insertion.insertion_geometry import WALL_MARGIN_M
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
    """The start of an episode; episodes do not change it."""

    operation: int
    """The operation, counted from 0."""
    parts: Poses
    """Poses of the parts at the beginning of the plan."""
    transfer: Transfer
    """The transfer with the errors of the robot in its poses: where the robot really goes."""
    grip: Grip
    """The grip in use."""
    second: Grip | None
    """The grip after the guarded motion; None if it does not change."""
    direction: Array
    """The insertion axis by the robot's own estimate, unit vector, (3,), world."""
    off: Array
    """True minus measured joint angles, (joints,), [rad]."""
    sag: Array
    """Compliance of the joints behind their encoders, (joints,) or (1,), [rad/(N m)]."""
    saved: SavedState
    """The state of the physics and the controller."""
    wrist: WristSensor
    """The wrist sensor, tared; episodes copy it by `WristSensor.at`."""
    after: tuple[Snapshot | None, ...]
    """A snapshot after each earlier operation."""


def prepare_start(
    plan: Plan, scene: Scene, k: int, config: ExecutionConfig, sensor: tuple[str, tuple[int, ...]]
) -> Start | Outcome:
    """Execute a plan up to where the guarded motion of an operation begins.

    Args:
        k: The operation, counted from 0; if the schedule repeats it, the last time.
        config: How the robot executes the plan; fidelity is always `near-contact`, and `spiral` is always on.
        sensor: Name of the force-torque sensor at the wrist, and the seed of its noise.

    Returns:
        The start, or the outcome if an earlier step failed.
    """
    at = max(i for i, step in enumerate(plan.schedule) if step.operation == k and not step.undo)
    config = replace(config, fidelity="near-contact", spiral=True)
    robot = Robot(scene, plan.start, Hooks(), config.fidelity, config.robot_error)
    execution = Execution(plan, robot, config)
    with allow_sleep(scene.work, scene.grasp == "friction"):
        # The keys only have to differ: the cache is new, so nothing is found in it.
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
    """Prepare the start of the next operation after an agent has released a part; without probing.

    Args:
        robot: The robot as the agent has moved it from `start`; its controller stays unchanged.
        start: The start of the present operation.
        reached: The snapshot after this operation.
        error: The errors of the robot.
        sensor: As for `prepare_start`.

    Returns:
        The start, or the outcome if picking or carrying the part failed.
    """
    config = ExecutionConfig("near-contact", spiral=True, robot_error=error)
    execution = Execution(plan, Robot(robot.scene, start.parts, Hooks(), config.fidelity, error), config)
    execution.progress.after[:] = [*start.after, reached]
    with allow_sleep(robot.scene.work, robot.scene.grasp == "friction"):
        restore_state(save_state(robot, 0, execution.progress), execution.robot)
        return _hold(execution, execution.moves()[start.operation + 1], sensor)


def _hold(execution: Execution, move: Move, sensor: tuple[str, tuple[int, ...]]) -> Start | Outcome:
    """Pick the part of a move, carry it to before its hole, and tare the wrist sensor there."""
    robot = execution.robot
    robot.step, t = move
    k = robot.step.operation
    if not t.into.level and t.entrances:  # from above, every entrance is passed slowly
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
    left = execution.residual  # errors that remain after compensation
    return Start(
        operation=k,
        parts=dict(execution.plan.start),
        transfer=t,
        grip=grip,
        second=second,
        direction=t.into.direction if left is None else left.hand_eye[:3, :3].T @ t.into.direction,
        off=np.zeros(len(robot.scene.arm.joints)) if left is None else left.joints,
        sag=np.zeros(1) if left is None else left.sag,
        saved=save_state(robot, i, execution.progress),
        # A template without a robot: each episode connects it to its own simulation.
        wrist=wrist.at(np.zeros(len(robot.data.sensordata)), _no_encoders, np.random.default_rng(0)),
        after=tuple(execution.progress.after[:k]),
    )


def _no_encoders() -> Array:
    """Stand for the encoders in a wrist sensor that is not connected to a robot."""
    return np.zeros(0)
