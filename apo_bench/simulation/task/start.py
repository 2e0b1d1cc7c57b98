"""Where an episode starts: the operations before it are done, and the robot holds the part before its mouth.

A start is a state of the physics and what the robot knows; made once, it is taken up again as often as wanted.
"""

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import final

import numpy as np

from apo_bench.assembly import Outcome, Plan, Poses, Snapshot
from apo_bench.geometry import Array, pose
from apo_bench.planning.insertion.surroundings import WALL_MARGIN_M
from apo_bench.records import sentence
from apo_bench.simulation.execution import (
    Grip,
    Move,
    Progress,
    ReplayCache,
    SavedState,
    Transfer,
    before_attach,
    moves_of,
    run_schedule,
    saved_state,
    take,
    take_up,
)
from apo_bench.simulation.execution.probing.feeling import ProbingConfig, ProbingState
from apo_bench.simulation.execution.probing.touching import lay
from apo_bench.simulation.hooks import Hooks
from apo_bench.simulation.robot import Halt, Robot, RobotError, WristSensor, part_loads, wrist_of, zero
from apo_bench.simulation.scene import Scene, sleeping


@final
@dataclass(frozen=True, eq=False)
class Start:
    """One start; nothing changes it."""

    operation: int
    """Counted from 0."""
    parts: Poses
    """Where the parts stood at first."""
    transfer: Transfer
    """With what is wrong with the robot in its poses: where the robot really goes."""
    grip: Grip
    second: Grip | None
    """The grip after the guarded motion, if it is changed then."""
    way: Array
    """The way in as the robot believes it, unit vector, (3,), world."""
    off: Array
    """(joints,), by how much each joint is off its encoder, [rad]."""
    saved: SavedState
    wrist: WristSensor
    """Zeroed here."""
    after: tuple[Snapshot | None, ...]
    """After each operation before."""


def prepare(
    plan: Plan,
    scene: Scene,
    k: int,
    error: RobotError | None = None,
    probing: ProbingConfig | None = None,
    wrench: tuple[str, tuple[int, ...]] = ("uncorrected", (0,)),
) -> Start | Outcome:
    """Carry out a plan up to where the guarded motion of an operation begins; or say what failed before.

    Args:
        k: The operation, counted from 0; the last time that it is done.
        feels: How the robot finds out first what is wrong with it; None: it does not.
        wrench: The sensor at the wrist, by name, and the seed of its noise.
    """
    feeling = None if probing is None else ProbingState(probing, plan, scene, error)
    acts = () if probing is None else probing.acts
    at = max(i for i, step in enumerate(plan.schedule) if step.operation == k and not step.undo)
    moves = partial(moves_of, plan, scene, True, acts)
    robot = Robot(scene, plan.start, Hooks(), "near-contact", error)
    progress = Progress([None] * len(plan.assembly), [])
    keys = [b"%d" % i for i in range(2 * at)]
    with sleeping(scene.work, scene.grasp == "friction"):

        def earlier(left: RobotError | None) -> tuple[Move, ...]:
            return moves(left)[:at]

        outcome = run_schedule(plan, robot, earlier(error), progress, ReplayCache(), keys, math.inf, feeling, earlier)
        if outcome.failed:
            return outcome
        left = error if feeling is None else feeling.residual
        return _held(plan, robot, moves(left)[at], feeling, left, wrench, progress)


def go_on(
    plan: Plan,
    robot: Robot,
    start: Start,
    reached: Snapshot,
    error: RobotError | None,
    wrench: tuple[str, tuple[int, ...]],
) -> Start | Outcome:
    """The start of the next operation, by the robot that has just let go of a part; as `prepare`, without feeling.

    Args:
        robot: As somebody else has led it from `start`; it is left as it is.
        reached: What it has reached.
    """
    progress = Progress([*start.after, reached], [])
    other = Robot(robot.scene, start.parts, Hooks(), "near-contact", error)
    with sleeping(robot.scene.work, robot.scene.grasp == "friction"):
        take_up(saved_state(robot, 0, progress), other)
        move = moves_of(plan, robot.scene, True, (), error)[start.operation + 1]
        return _held(plan, other, move, None, error, wrench, progress)


def _held(
    plan: Plan,
    robot: Robot,
    move: Move,
    feeling: ProbingState | None,
    left: RobotError | None,
    wrench: tuple[str, tuple[int, ...]],
    progress: Progress,
) -> Start | Outcome:
    """Take the part of a move and hold it before its mouth.

    Args:
        left: What is wrong with the robot and not made up for.
    """
    robot.step, t = move
    k = robot.step.operation
    if not t.into.level and t.mouths:
        t = replace(t, in_last=True, slow=max(t.slow, max(t.mouths) + WALL_MARGIN_M))
    try:
        with robot.watch_stability():
            i = take(robot, t, again=feeling is not None and "square" in feeling.acts)
            robot.slip(k)
            laying = None
            if feeling is not None:
                feeling.taken(k)
                laying = None if t.flush is None else partial(lay, robot, feeling, k)
            grip, second = before_attach(robot, t, i, laying)
            wrist = wrist_of(robot, wrench[0], np.random.default_rng(wrench[1]))
            wrist.hold(*part_loads(robot.scene, {t.part: pose.inverse(grip.T_part_tip)}))
            zero(robot, wrist)
    except Halt as halt:
        return Outcome(halt.stage, halt.code, k, sentence(halt.code, part=halt.part or t.part, operation=k))
    return Start(
        operation=k,
        parts=dict(plan.start),
        transfer=t,
        grip=grip,
        second=second,
        way=t.into.way if left is None else left.hand_eye[:3, :3].T @ t.into.way,
        off=np.zeros(len(robot.scene.arm.joints)) if left is None else left.joints,
        saved=saved_state(robot, i, progress),
        wrist=wrist.at(np.zeros(len(robot.data.sensordata)), _nowhere, np.random.default_rng(0)),
        after=tuple(progress.after[:k]),
    )


def _nowhere() -> Array:
    """The encoders of no robot."""
    return np.zeros(0)
