"""Calibration of a robot by contact probing: hand-eye displacement, encoders, tool, and slip of parts in the hand.

A touch is a contact equation for the robot instead of a pose: a point of the hand, or of a held part, lies on a known
plane. `make_prior_estimate` starts from the stated errors of the robot; `RobotEstimate.touch` updates it by touches.
"""

from apo_bench.assembly.probing_touch import Touch
from apo_bench.correction.calibration.robot_estimate import (
    UNKNOWN,
    RobotEstimate,
    compute_slip_sigmas,
    make_prior_estimate,
)
from apo_bench.correction.calibration.robust_estimate import REFUSED_BEYOND

__all__ = ("REFUSED_BEYOND", "UNKNOWN", "RobotEstimate", "Touch", "compute_slip_sigmas", "make_prior_estimate")
