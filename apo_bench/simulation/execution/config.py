"""The settings of one execution of a plan: fidelity, search, time limit, robot errors, probing."""

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
    """How the robot executes a plan. Default: a robot without errors that neither searches nor probes.

    Raises:
        InputError: The fidelity is unknown.

    Examples:
        >>> import apo_bench
        >>> apo_bench.ExecutionConfig(fidelity="near-contact", spiral=True).searches
        True
    """

    fidelity: str = "full"
    """`full`, or `near-contact`: only the part of each motion in which parts may touch is simulated."""
    spiral: bool = False
    """Whether the robot searches along a spiral for a hole when contact stops the insertion."""
    time_limit_s: float = math.inf
    """Simulated time after which no step begins, [s]."""
    robot_error: RobotError | None = None
    """The calibration errors of the robot, unknown to it; None: no errors."""
    probing: ProbingConfig | None = None
    """How the robot probes fixed surfaces to estimate its errors; None: it does not."""

    def __post_init__(self) -> None:
        check("fidelity", self.fidelity)

    @property
    def searches(self) -> bool:
        """Whether the robot searches for holes: a robot that probes always does."""
        return self.spiral or self.probing is not None


DEFAULT_EXECUTION = ExecutionConfig()
"""A robot without errors, every motion simulated."""
