"""How a robot probes: its actions, its sensor, and the calibration estimate from which it starts."""

from dataclasses import dataclass
from typing import Protocol, final

from apo_bench.assembly import ProbingResult, Touch
from apo_bench.geometry import Array
from apo_bench.records import USUAL_FT_SENSOR

PROBING_ACTIONS = ("square", "touch", "lay", "search")
"""Parts are squared before they are taken, what is fixed is touched, what is inserted is laid flat first (and touches a
wall, if it comes from above), and what is stopped all the same is searched for."""


class CalibrationEstimate(Protocol):
    """The estimated errors of a robot, updated by touches: `apo_bench.correction.calibration` has one."""

    @property
    def hand_eye(self) -> Array:
        """Where the robot goes, (4, 4), for the frame that it takes for the world."""

    @property
    def tool(self) -> Array:
        """How far the tip is off on the hand, (3,), in its own frame, [m]."""

    @property
    def encoders(self) -> Array:
        """How far each joint is off what its encoder says, (joints,), [rad]."""

    @property
    def found(self) -> ProbingResult:
        """What has been found out."""

    def grasp(self, number: int, sigmas: Array) -> "CalibrationEstimate":
        """A part was grasped, which may have moved in the hand by so much, (6,), [m, rad]."""

    def touch(self, *touches: Touch) -> "CalibrationEstimate":
        """Learn from touches."""

    def real(self, T_world_tip: Array, jacobian: Array | None) -> Array:
        """Where the tip really is, (4, 4)."""

    def command(self, T_world_tip: Array, jacobian: Array | None) -> Array:
        """The inverse of `real`."""

    def covariance_of(self, T_world_tip: Array, jacobian: Array | None) -> Array:
        """How uncertain is where the tip really is, (6, 6), of its body twist."""

    def held(self, grasp: int, T_tip_part: Array) -> Array:
        """Where a part lies in the frame of the tip, (4, 4)."""


@final
@dataclass(frozen=True, eq=False)
class ProbingConfig:
    """How a robot probes what is fixed to estimate its own errors."""

    estimate: CalibrationEstimate
    """Before anything is touched."""
    slip: Array
    """(6,): how far a part may slip in the hand, standard deviations of a twist in the frame of the tip, [m, rad]."""
    seed: tuple[int, ...]
    """Of the noise of its sensor."""
    ft_sensor: str = USUAL_FT_SENSOR
    """The sensor at its wrist, as in `parse_ft_noise`."""
    actions: tuple[str, ...] = PROBING_ACTIONS
    """Of `PROBING_ACTIONS`."""
