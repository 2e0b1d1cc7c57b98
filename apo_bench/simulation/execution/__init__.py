"""A plan carried out by the robot."""

from apo_bench.simulation.execution.beside import STAND_OFF_M
from apo_bench.simulation.execution.carry_out import after_attach, before_attach, end_of_attach, pace, take
from apo_bench.simulation.execution.controller import moves_of, replay, run_schedule, until_rest
from apo_bench.simulation.execution.fingers import OPEN_TO_PICK_M, OPEN_TO_RELEASE_M, check_hold, depart, release
from apo_bench.simulation.execution.grasping import RestingPart, Stroke, first_clear, obstacles, tip_frame
from apo_bench.simulation.execution.prepare import Move, holds_firmly, in_reach, key_angles, moves
from apo_bench.simulation.execution.replay_cache import Progress, ReplayCache, SavedState, saved_state, take_up
from apo_bench.simulation.execution.transfer import Grip, Transfer, after_transfer, arrival_line, hover

__all__ = (
    "OPEN_TO_PICK_M",
    "OPEN_TO_RELEASE_M",
    "STAND_OFF_M",
    "Grip",
    "Move",
    "Progress",
    "ReplayCache",
    "RestingPart",
    "SavedState",
    "Stroke",
    "Transfer",
    "after_attach",
    "after_transfer",
    "arrival_line",
    "before_attach",
    "check_hold",
    "depart",
    "end_of_attach",
    "first_clear",
    "holds_firmly",
    "hover",
    "in_reach",
    "key_angles",
    "moves",
    "moves_of",
    "obstacles",
    "pace",
    "release",
    "replay",
    "run_schedule",
    "saved_state",
    "take",
    "take_up",
    "tip_frame",
    "until_rest",
)
