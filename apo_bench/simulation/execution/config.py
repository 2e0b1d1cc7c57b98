"""The settings of one execution of a plan."""

import math
from dataclasses import dataclass
from typing import final

from apo_bench.arguments import check_arguments
from apo_bench.records import check
from apo_bench.simulation.execution.probing.config import ProbingConfig
from apo_bench.simulation.robot import RobotError


@final
@check_arguments
@dataclass(frozen=True, eq=False)
class ExecutionConfig:
    """How the robot executes a plan; by default a robot without errors that neither searches nor probes.

    Raises:
        InputError: The fidelity is unknown.
    """

    fidelity: str = "full"
    """`full`, or `near-contact`: the simulation skips stretches of a motion on which nothing is near. With a grasp by
    friction, parts that rest untouched sleep in both."""
    spiral: bool = False
    """Whether the robot searches for a hole along a spiral where force stops a motion into it."""
    time_limit_s: float = math.inf
    """Simulated time after which no step begins; a schedule that surely takes longer does not begin."""
    robot_error: RobotError | None = None
    """The errors of the robot, which it does not know; None: it has none."""
    probing: ProbingConfig | None = None
    """How the robot estimates its errors by touching what is fixed; None: it does not."""

    def __post_init__(self) -> None:
        check("fidelity", self.fidelity)

    @property
    def actions(self) -> tuple[str, ...]:
        """The probing actions of the robot, none without probing."""
        return () if self.probing is None else self.probing.actions

    @property
    def searches(self) -> bool:
        """Whether the robot searches for holes, by the spiral or as a probing action."""
        return self.spiral or "search" in self.actions


DEFAULT_EXECUTION = ExecutionConfig()
"""A robot without errors, every motion simulated."""
