"""The robot executes a plan: prepared transfers, carried out by guarded motions, with search, probing and a cache."""

from apo_bench.simulation.execution.carry_out import carry_to_attach, choose_pace, find_attach_end, finish_attach
from apo_bench.simulation.execution.config import DEFAULT_EXECUTION, ExecutionConfig
from apo_bench.simulation.execution.controller import replay
from apo_bench.simulation.execution.execution import Execution
from apo_bench.simulation.execution.fingers import OPEN_TO_PICK_M, OPEN_TO_RELEASE_M, check_hold, depart, release
from apo_bench.simulation.execution.grasp_clearance import RestingPart, Stroke, find_clear_grasp, list_obstacles
from apo_bench.simulation.execution.grasp_frame import make_tip_frame
from apo_bench.simulation.execution.prepare import Move, in_reach, plan_moves, solve_key_angles
from apo_bench.simulation.execution.replay_cache import ReplayCache, SavedState, restore_state, save_state
from apo_bench.simulation.execution.resting import wait_for_rest
from apo_bench.simulation.execution.side_touches import STAND_OFF_M
from apo_bench.simulation.execution.transfer import (
    SAFE_M,
    Grip,
    Transfer,
    compute_transferred_poses,
    find_hover_pose,
    plan_arrival_line,
)

__all__ = (
    "DEFAULT_EXECUTION",
    "OPEN_TO_PICK_M",
    "OPEN_TO_RELEASE_M",
    "SAFE_M",
    "STAND_OFF_M",
    "Execution",
    "ExecutionConfig",
    "Grip",
    "Move",
    "ReplayCache",
    "RestingPart",
    "SavedState",
    "Stroke",
    "Transfer",
    "carry_to_attach",
    "check_hold",
    "choose_pace",
    "compute_transferred_poses",
    "depart",
    "find_attach_end",
    "find_clear_grasp",
    "find_hover_pose",
    "finish_attach",
    "in_reach",
    "list_obstacles",
    "make_tip_frame",
    "plan_arrival_line",
    "plan_moves",
    "release",
    "replay",
    "restore_state",
    "save_state",
    "solve_key_angles",
    "wait_for_rest",
)
