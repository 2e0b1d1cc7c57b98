"""The arm in motion: lines followed, contacts felt."""

from apo_bench.simulation.robot.by_wrist import comply, press, reading, servo, wrist_of, zero
from apo_bench.simulation.robot.gripper import ArmAlone, HasGripper, gripper_boxes
from apo_bench.simulation.robot.in_hand import TINY_S, HoldWatch, take_along, weld
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
from apo_bench.simulation.robot.reach import at_end, led_there, way_there
from apo_bench.simulation.robot.robot import Halt, Robot
from apo_bench.simulation.robot.robot_error import RobotError
from apo_bench.simulation.robot.wrist import (
    BANDWIDTH_HZ,
    READING_S,
    Guard,
    LowPass,
    WristSensor,
    felt_noise,
    low_pass_part,
    part_loads,
)

__all__ = (
    "BANDWIDTH_HZ",
    "READING_S",
    "TINY_S",
    "ArmAlone",
    "Guard",
    "Halt",
    "HasGripper",
    "HoldWatch",
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
    "gripper_boxes",
    "led_there",
    "low_pass_part",
    "minimum_jerk",
    "near_spans",
    "obstacle",
    "paced",
    "part_loads",
    "press",
    "reading",
    "servo",
    "shifted",
    "smooth",
    "steady",
    "take_along",
    "turn_from",
    "way_there",
    "weld",
    "with_height",
    "wrist_of",
    "zero",
)
