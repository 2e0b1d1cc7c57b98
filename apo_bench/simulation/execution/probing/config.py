"""The settings of probing: sensor, expected slip, and the calibration estimate that touches update."""

from dataclasses import dataclass
from typing import Protocol, final

from apo_bench.assembly import ProbingResult, Touch
from apo_bench.geometry import Array
from apo_bench.records import USUAL_FT_SENSOR


class CalibrationEstimate(Protocol):
    """The estimated errors of a robot, updated by touches: `apo_bench.correction.calibration` has one."""

    @property
    def hand_eye(self) -> Array:
        """Estimated hand-eye error E, (4, 4): the robot goes to E T for a pose T in the world."""

    @property
    def tool(self) -> Array:
        """Estimated offset of the tip on the hand, (3,), in the frame of the tip, [m]."""

    @property
    def encoders(self) -> Array:
        """Estimated true minus measured joint angles, (joints,), [rad]."""

    @property
    def sags(self) -> bool:
        """Whether the last column of a Jacobian is the displacement of the tip by a sag of 1 m, as a body twist."""

    @property
    def sag(self) -> float:
        """Estimated height that the tip loses by the weight of the arm, [m]."""

    @property
    def found(self) -> ProbingResult:
        """The estimates and their uncertainties, for the result of a replay."""

    def grasp(self, number: int, sigmas: Array) -> "CalibrationEstimate":
        """Return the estimate with a further held part, whose pose in the hand is uncertain.

        Args:
            number: Identifies the grasp: the operation.
            sigmas: Standard deviations of this pose, (6,), [m, rad].
        """

    def touch(self, *touches: Touch) -> "CalibrationEstimate":
        """Return the estimate updated by touches."""

    def real(self, T_world_tip: Array, jacobian: Array | None) -> Array:
        """Return the estimated pose of the real tip, (4, 4).

        Args:
            T_world_tip: Pose that a robot without errors would have, (4, 4).
            jacobian: Body Jacobian of the tip there, (6, joints), with the sag if `sags`; None: both are left out.
        """

    def command(self, T_world_tip: Array, jacobian: Array | None) -> Array:
        """Return the pose to command, (4, 4), so that the real tip comes to `T_world_tip`: the inverse of `real`."""

    def covariance_of(self, T_world_tip: Array, jacobian: Array | None) -> Array:
        """Return the covariance of the pose of the real tip, (6, 6), as a body twist, [m, rad]."""

    def held(self, grasp: int, T_tip_part: Array) -> Array:
        """Return the estimated pose of a held part in the frame of the tip, (4, 4).

        Args:
            grasp: As `number` of `grasp`.
            T_tip_part: The pose estimated when the part was grasped, (4, 4).
        """


@final
@dataclass(frozen=True, eq=False)
class ProbingConfig:
    """How a robot probes surfaces to estimate its own errors.

    It squares parts before the pick, touches fixed parts with the hand, lays parts flat before their insertion (from
    above, they then also touch a wall), and searches for the hole if an insertion is stopped.
    """

    estimate: CalibrationEstimate
    """The calibration estimate before any touch."""
    slip: Array
    """Standard deviations of the slip in the hand, (6,), of a twist in the frame of the tip, [m, rad]."""
    seed: tuple[int, ...]
    """Seed of the sensor noise."""
    ft_sensor: str = USUAL_FT_SENSOR
    """The sensor at the wrist, as in `parse_ft_noise`."""
    pads_m: float = 0.0
    """Standard deviation of the middle between the pads along x of the tip, [m]; 0: it is not probed."""
