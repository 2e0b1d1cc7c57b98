"""The robot of an environment: what is wrong with it, whether it feels, and one replay by it."""

from typing import Any, NamedTuple

import numpy as np

from apo_bench.assembly import Plan
from apo_bench.errors import kind, require
from apo_bench.geometry import Array
from apo_bench.records import checked_robot_error, checked_stated_error, checked_wrench, told_error
from apo_bench.simulation.scene.scene import Scene
from apo_bench.trial.feeling import feels_of
from apo_bench.trial.stages import WRENCH, Attempt, draw_robot_error, replay_and_judge, stream_key

LONGEST_REPLAY_S = 1000.0
"""Simulated time after which a replay begins no further step: seven times the longest of the benchmark."""


class RobotSettings(NamedTuple):
    """As the environment's arguments of these names."""

    robot_error: str
    feels: bool
    wrench: str
    stated_error: str

    def checked(self) -> "RobotSettings":
        """The same, spelled as rows spell them.

        Raises:
            InputError: An unknown name, a number that is not allowed, or no truth value.
        """
        require(
            isinstance(self.feels, bool | np.bool_),
            f"{kind(self.feels)} was given as feels; True or False is allowed: whether the robot feels.",
        )
        error = checked_robot_error(self.robot_error)
        return RobotSettings(
            error, bool(self.feels), checked_wrench(self.wrench), checked_stated_error(self.stated_error)
        )


def carried_out(
    robot: RobotSettings, plan: Plan, scene: Scene, reference: Array, trial: int, watch: Any, fidelity: str
) -> Attempt:
    """One replay by this robot, and the verdict on it.

    Args:
        reference: As in `replay_and_judge`.
        trial: Its number; the robot's errors, and the noise of what it feels, are those of this trial.
        watch, fidelity: As in `replay_and_judge`.
    """
    told = told_error(robot.stated_error, robot.robot_error)
    return replay_and_judge(
        plan,
        scene,
        reference,
        watch,
        fidelity,
        searches=robot.feels,
        most_s=LONGEST_REPLAY_S,
        error=draw_robot_error(robot.robot_error, scene, trial),
        feels=feels_of(plan, scene, told, stream_key(trial, WRENCH), robot.wrench) if robot.feels else None,
    )
