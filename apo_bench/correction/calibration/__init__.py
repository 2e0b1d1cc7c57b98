"""Calibration of a robot by contact probing: hand-eye, encoders, tool, and how each part lies in the hand.

A touch is a contact equation on the robot instead of on a pose: a point of the hand, or of what it holds, lies on a
known plane. `make_prior_estimate` begins with what is stated of the robot, `RobotEstimate.touch` learns from touches.
"""

from apo_bench.assembly.touch import Touch
from apo_bench.correction.calibration.robot_estimate import (
    UNKNOWN,
    RobotEstimate,
    compute_slip_sigmas,
    make_prior_estimate,
)
from apo_bench.correction.calibration.robust_estimate import REFUSED_BEYOND

__all__ = ("REFUSED_BEYOND", "UNKNOWN", "RobotEstimate", "Touch", "compute_slip_sigmas", "make_prior_estimate")
