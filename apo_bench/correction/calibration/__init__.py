"""What is wrong with a robot, told by what it touches: hand-eye, encoders, tool, and how each part lies in the hand.

A touch is a contact equation on the robot instead of on a goal: a point of the hand, or of what it holds, lies on a
known plane. `believe` begins with what is stated of the robot, `RobotBelief.touch` learns from touches.
"""

from apo_bench.assembly.touch import Touch
from apo_bench.correction.calibration.belief import UNKNOWN, RobotBelief, believe, slip_sigmas
from apo_bench.correction.calibration.robust_estimate import REFUSED_BEYOND

__all__ = ("REFUSED_BEYOND", "UNKNOWN", "RobotBelief", "Touch", "believe", "slip_sigmas")
