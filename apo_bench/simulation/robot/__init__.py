"""The arm in motion: lines followed, contacts felt."""

from apo_bench.simulation.robot.by_wrist import comply, press, reading, servo, wrist_of, zero
from apo_bench.simulation.robot.forces import Guard, LowPass
from apo_bench.simulation.robot.gripper import ArmAlone, HasGripper, gripper_boxes
from apo_bench.simulation.robot.in_hand import TINY_S, take_along, weld
from apo_bench.simulation.robot.obstacles import Moving, Obstacle, near_spans, obstacle
from apo_bench.simulation.robot.paths import (
    Trajectory,
    minimum_jerk,
    paced,
    shifted,
    smooth,
    steady,
    turn_from,
    with_height,
)
from apo_bench.simulation.robot.reach import at_end, follow_waypoints, plan_waypoints
from apo_bench.simulation.robot.robot import ExecutionAborted, Robot
from apo_bench.simulation.robot.robot_error import RobotError
from apo_bench.simulation.robot.slip_monitor import GraspSlipMonitor
from apo_bench.simulation.robot.wrist import BANDWIDTH_HZ, READING_S, WristSensor, felt_noise, low_pass_part, part_loads

__all__ = (
    "BANDWIDTH_HZ",
    "READING_S",
    "TINY_S",
    "ArmAlone",
    "ExecutionAborted",
    "GraspSlipMonitor",
    "Guard",
    "HasGripper",
    "LowPass",
    "Moving",
    "Obstacle",
    "Robot",
    "RobotError",
    "Trajectory",
    "WristSensor",
    "at_end",
    "comply",
    "felt_noise",
    "follow_waypoints",
    "gripper_boxes",
    "low_pass_part",
    "minimum_jerk",
    "near_spans",
    "obstacle",
    "paced",
    "part_loads",
    "plan_waypoints",
    "press",
    "reading",
    "servo",
    "shifted",
    "smooth",
    "steady",
    "take_along",
    "turn_from",
    "weld",
    "with_height",
    "wrist_of",
    "zero",
)
