"""The arm in motion: it follows lines and measures contact forces."""

from apo_bench.simulation.robot.by_wrist import comply, press, reading, servo, wrist_of, zero
from apo_bench.simulation.robot.forces import Guard, LowPass
from apo_bench.simulation.robot.gripper import gripper_boxes
from apo_bench.simulation.robot.in_hand import TINY_S, take_along, weld
from apo_bench.simulation.robot.obstacles import Moving, Obstacle, near_spans, obstacle
from apo_bench.simulation.robot.paths import (
    Trajectory,
    minimum_jerk,
    paced_trajectory,
    smooth_trajectory,
    steady_trajectory,
    translate,
    turn_from,
    with_height,
)
from apo_bench.simulation.robot.reach import at_end, follow_waypoints, plan_waypoints
from apo_bench.simulation.robot.robot import ExecutionAborted, Robot
from apo_bench.simulation.robot.robot_error import RobotError
from apo_bench.simulation.robot.slip_monitor import GraspSlipMonitor
from apo_bench.simulation.robot.wrist import (
    BANDWIDTH_HZ,
    READING_S,
    WristSensor,
    filtered_noise,
    low_pass_part,
    part_loads,
)

__all__ = (
    "BANDWIDTH_HZ",
    "READING_S",
    "TINY_S",
    "ExecutionAborted",
    "GraspSlipMonitor",
    "Guard",
    "LowPass",
    "Moving",
    "Obstacle",
    "Robot",
    "RobotError",
    "Trajectory",
    "WristSensor",
    "at_end",
    "comply",
    "filtered_noise",
    "follow_waypoints",
    "gripper_boxes",
    "low_pass_part",
    "minimum_jerk",
    "near_spans",
    "obstacle",
    "paced_trajectory",
    "part_loads",
    "plan_waypoints",
    "press",
    "reading",
    "servo",
    "smooth_trajectory",
    "steady_trajectory",
    "take_along",
    "translate",
    "turn_from",
    "weld",
    "with_height",
    "wrist_of",
    "zero",
)
