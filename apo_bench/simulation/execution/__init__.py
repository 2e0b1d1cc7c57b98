"""The robot executes a plan."""

from apo_bench.simulation.execution.carry_out import after_attach, before_attach, end_of_attach, pace
from apo_bench.simulation.execution.config import DEFAULT_EXECUTION, ExecutionConfig
from apo_bench.simulation.execution.controller import replay
from apo_bench.simulation.execution.execution import Execution
from apo_bench.simulation.execution.fingers import OPEN_TO_PICK_M, OPEN_TO_RELEASE_M, check_hold, depart, release
from apo_bench.simulation.execution.grasping import RestingPart, Stroke, first_clear, obstacles, tip_frame
from apo_bench.simulation.execution.prepare import Move, holds_firmly, in_reach, key_angles, moves
from apo_bench.simulation.execution.probing.config import PROBING_ACTIONS, ProbingConfig
from apo_bench.simulation.execution.replay_cache import ReplayCache, SavedState, restore_state, save_state
from apo_bench.simulation.execution.resting import wait_for_rest
from apo_bench.simulation.execution.side_touches import STAND_OFF_M
from apo_bench.simulation.execution.transfer import Grip, Transfer, after_transfer, arrival_line, hover

__all__ = (
    "DEFAULT_EXECUTION",
    "OPEN_TO_PICK_M",
    "OPEN_TO_RELEASE_M",
    "PROBING_ACTIONS",
    "STAND_OFF_M",
    "Execution",
    "ExecutionConfig",
    "Grip",
    "Move",
    "ProbingConfig",
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
    "obstacles",
    "pace",
    "release",
    "replay",
    "restore_state",
    "save_state",
    "tip_frame",
    "wait_for_rest",
)
