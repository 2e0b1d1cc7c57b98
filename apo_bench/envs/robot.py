"""The robot of an environment: its errors, its probing, and the execution of a plan."""

from typing import Any, NamedTuple

from apo_bench.assembly import Plan
from apo_bench.geometry import Array
from apo_bench.records import (
    normalise_assumed_robot_error,
    normalise_ft_sensor,
    normalise_robot_error,
    parse_assumed_error,
)
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.simulation.scene import Scene
from apo_bench.trial.run import probing_config
from apo_bench.trial.trial_stages import WRENCH, Attempt, draw_robot_error, replay_and_judge, stream_key

LONGEST_REPLAY_S = 1000.0
"""Simulated time after which a replay starts no further step: seven times the longest replay of the benchmark."""


class RobotSettings(NamedTuple):
    """The arguments of an environment that concern the robot."""

    robot_error: str
    probe: bool
    ft_sensor: str
    assumed_robot_error: str

    def checked(self) -> "RobotSettings":
        """Return the settings in canonical spelling.

        Raises:
            InputError: An unknown name, or a number that is not allowed.
        """
        return RobotSettings(
            normalise_robot_error(self.robot_error),
            bool(self.probe),
            normalise_ft_sensor(self.ft_sensor),
            normalise_assumed_robot_error(self.assumed_robot_error),
        )

    @property
    def assumed(self) -> str | None:
        """The robot error that the robot assumes, as in `parse_robot_error`; None if it is unknown."""
        return parse_assumed_error(self.assumed_robot_error, self.robot_error)

    def execution(self, plan: Plan, scene: Scene, trial: int, fidelity: str = "full") -> ExecutionConfig:
        """Return the execution settings of a trial, whose number determines robot errors and sensor noise."""
        probing = probing_config(plan, scene, self.assumed, stream_key(trial, WRENCH), self.ft_sensor)
        return ExecutionConfig(
            fidelity,
            spiral=self.probe,
            time_limit_s=LONGEST_REPLAY_S,
            robot_error=draw_robot_error(self.robot_error, scene, trial),
            probing=probing if self.probe else None,
        )


def execute_plan(
    robot: RobotSettings, plan: Plan, scene: Scene, reference: Array, trial: int, watch: Any, fidelity: str
) -> Attempt:
    """Replay a plan once with this robot, and judge the result.

    Args:
        reference: True poses, as in `replay_and_judge`.
        trial: Number of the trial, which determines the robot's errors and the noise of its sensor.
        watch: Callbacks, as in `replay_and_judge`.
        fidelity: As in `ExecutionConfig`.
    """
    return replay_and_judge(plan, scene, reference, watch, robot.execution(plan, scene, trial, fidelity))
