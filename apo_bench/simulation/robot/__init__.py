"""The simulated robot: its motions along lines, its force sensors, its gripper and its errors."""

from apo_bench.simulation.robot.by_wrist import comply, get_wrist, press, read_wrist, servo, zero, zero_again
from apo_bench.simulation.robot.force_steps import ForceSteps
from apo_bench.simulation.robot.forces import Guard, LowPass
from apo_bench.simulation.robot.gripper import list_gripper_boxes
from apo_bench.simulation.robot.in_hand import TINY_S, take_along, weld
from apo_bench.simulation.robot.obstacles import MovingPieces, Obstacle, find_near_spans, make_obstacle
from apo_bench.simulation.robot.paths import (
    Trajectory,
    interpolate_minimum_jerk,
    measure_turn,
    move_to_height,
    plan_paced_trajectory,
    plan_steady_trajectory,
    smooth_trajectory,
    translate,
)
from apo_bench.simulation.robot.reach import follow_waypoints, plan_waypoints, solve_end_angles
from apo_bench.simulation.robot.robot import ExecutionAborted, Robot
from apo_bench.simulation.robot.robot_error import RobotError
from apo_bench.simulation.robot.sag import compute_sag_per_metre
from apo_bench.simulation.robot.slip_monitor import GraspSlipMonitor
from apo_bench.simulation.robot.wrist import (
    BANDWIDTH_HZ,
    READING_S,
    WristSensor,
    compute_low_pass_gain,
    compute_part_loads,
    filter_noise,
)

__all__ = (
    "BANDWIDTH_HZ",
    "READING_S",
    "TINY_S",
    "ExecutionAborted",
    "ForceSteps",
    "GraspSlipMonitor",
    "Guard",
    "LowPass",
    "MovingPieces",
    "Obstacle",
    "Robot",
    "RobotError",
    "Trajectory",
    "WristSensor",
    "comply",
    "compute_low_pass_gain",
    "compute_part_loads",
    "compute_sag_per_metre",
    "filter_noise",
    "find_near_spans",
    "follow_waypoints",
    "get_wrist",
    "interpolate_minimum_jerk",
    "list_gripper_boxes",
    "make_obstacle",
    "measure_turn",
    "move_to_height",
    "plan_paced_trajectory",
    "plan_steady_trajectory",
    "plan_waypoints",
    "press",
    "read_wrist",
    "servo",
    "smooth_trajectory",
    "solve_end_angles",
    "take_along",
    "translate",
    "weld",
    "zero",
    "zero_again",
)
