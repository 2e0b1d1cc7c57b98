"""Replay a plan with the robot: open loop in the poses, closed loop in force.

All correction methods are evaluated with this controller.
"""

import math
from collections.abc import Callable
from typing import Any

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Outcome, Plan, Poses, ReachedState, ReplayResult, Snapshot, list_poses_between_undos
from apo_bench.planning.prediction.stability import find_first_unstable
from apo_bench.simulation.execution.config import DEFAULT_EXECUTION, ExecutionConfig
from apo_bench.simulation.execution.execution import Execution, failed_outcome, moves_with_error
from apo_bench.simulation.execution.prepare import Move, solve_key_angles
from apo_bench.simulation.execution.replay_cache import ReplayCache, cache_keys
from apo_bench.simulation.execution.resting import wait_for_rest
from apo_bench.simulation.hooks import Hooks, as_hooks
from apo_bench.simulation.robot import ExecutionAborted, Robot
from apo_bench.simulation.scene import Scene, allow_sleep, take_snapshot

_SETTLE_S = 0.5
"""Time that the robot stands still after the last operation."""
_SHORTEST_STEP_S = 1.0
"""Lower bound of the duration of a step; the fastest replay of the benchmark takes four seconds a step."""


@check_arguments
def replay(
    plan: Plan,
    scene: Scene,
    watch: Hooks | Callable[[Any], None] | None = None,
    config: ExecutionConfig = DEFAULT_EXECUTION,
    parts_at: Poses | None = None,
    cache: ReplayCache | None = None,
) -> ReplayResult:
    """Execute a plan with the robot of a scene.

    Args:
        plan: From `fit_plan`, `Correction.plan` or `Observation.plan`.
        scene: From `build_scene`.
        watch: Called with the `MjData` about every 20 ms of simulated time; or several `Hooks`.
        config: How the robot executes it.
        parts_at: The true poses of the parts before the first operation, world frame, [m]; by default the plan's.
        cache: States that replays of this scene share; it changes only the computing time.

    Returns:
        The state that the robot reached, and how the replay ended; `judge` takes `reached`.
    """
    start = plan.start if parts_at is None else parts_at
    if len(plan.schedule) * _SHORTEST_STEP_S > config.time_limit_s:  # cannot end in time: not even planned
        todo: tuple[Move, ...] = ()
        refused: Outcome | None = failed_outcome(plan, "plan", "time_limit", plan.schedule[0].operation)
    else:
        todo = moves_with_error(plan, scene, config, config.robot_error)
        refused = _refusal(plan, scene, todo)
    # Hooks must see every step, and probing depends on more than the keys contain: such replays share no states.
    cache = ReplayCache() if cache is None or watch is not None or config.probing is not None else cache
    keys = cache_keys(scene, start, config.fidelity, todo, config.robot_error)
    same = None if refused or not keys or config.time_limit_s < math.inf else cache.ended(keys[-1])
    if same is not None:
        return same
    hooks = as_hooks(watch)
    hooks.before_replay(plan)
    robot = Robot(scene, start, hooks, config.fidelity, config.robot_error)
    execution = Execution(plan, robot, config)
    with allow_sleep(scene.work, scene.grasp == "friction"):
        outcome = refused or execution.run(todo, cache, keys)
        final = _settle(robot, plan) if outcome.code != "unstable_simulation" else None
    result = ReplayResult(
        reached=ReachedState(after=tuple(execution.progress.after), final=final),
        outcome=outcome,
        peak_force_n=robot.forces.peak_n,
        sim_time_s=float(robot.data.time),
        timeline=tuple(execution.progress.timeline),
        in_hand=robot.slip_monitor.finished,
        probing=None if execution.probing is None else execution.probing.estimate.found,
    )
    if keys and not refused and outcome.code != "time_limit":
        cache.end(keys[-1], result)
    return result


def _refusal(plan: Plan, scene: Scene, todo: tuple[Move, ...]) -> Outcome | None:
    """Return the outcome of a plan that fails before anything moves: unstable or out of reach; None if it is fine."""
    # Before each undo and at the end, the parts placed so far must stand stably at their targets.
    for upto, goals in list_poses_between_undos(plan):
        k = find_first_unstable(plan.assembly.first(upto), plan.start, goals[:upto])
        if k is not None:
            return failed_outcome(plan, "plan", "unstable_goal", k)
    for step, transfer in todo:
        if code := solve_key_angles(transfer, scene).code:
            return failed_outcome(plan, "plan", code, step.operation)
    return None


def _settle(robot: Robot, plan: Plan) -> Snapshot | None:
    """Wait until all parts rest; return their final poses, None if the simulation became unstable."""
    try:
        with robot.watch_stability():
            robot.wait(_SETTLE_S)
            wait_for_rest(robot)
    except ExecutionAborted as aborted:
        if aborted.code == "unstable_simulation":
            return None  # after any other failure the poses still count
    return take_snapshot(robot.scene.work, robot.data, plan.start)
