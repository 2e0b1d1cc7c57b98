"""The robot repeats a plan: open loop in the poses, closed loop only in force. The same controller for every method."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Outcome, Plan, Poses, Reached, ReplayResult, Snapshot, Step, poses_in_force
from apo_bench.planning.prediction.stability import first_unstable
from apo_bench.records import sentence, touching_sentence
from apo_bench.simulation.execution.carry_out import bring, take
from apo_bench.simulation.execution.prepare import Move, key_angles, moves
from apo_bench.simulation.execution.probing.feeling import ProbingConfig, ProbingState
from apo_bench.simulation.execution.probing.touching import find_out
from apo_bench.simulation.execution.probing.touching import lay as lay_down
from apo_bench.simulation.execution.replay_cache import Progress, ReplayCache, cache_keys
from apo_bench.simulation.hooks import Hooks, hooks_of
from apo_bench.simulation.robot import Halt, HoldWatch, Robot, RobotError
from apo_bench.simulation.scene import Scene, sleeping, snapshot

_SETTLE_S = 0.5
"""At the end, everything is left alone this long."""
_REST_M_S = 5e-5
_REST_RAD_S = 1e-3
"""Slower than this, all parts rest and the next operation may begin; a stick that rocks in its slot takes a while."""
_AT_FIRST_S = 0.05
"""Before the first operation the arm stands so long."""
LOOK_S = 0.04
PATIENCE_S = 1.5
"""After each step of the schedule and at the end the arm waits until parts rest: it looks so often, and goes on after
so long at most. What it waits for is the speed of the parts, which only the simulation knows; it decides when the arm
goes on, never where to."""
_SHORTEST_STEP_S = 1.0
"""Every step of a schedule takes longer: four seconds in the fastest replay of the benchmark."""
_STEPS = ((1.14, 3), (0.86, 2), (0.58, 8), (0.3, 4), (0.0, 1))
"""What has moved so long, [s], rocks: steps are taken in so many parts. Of 19 states that rocked on for ever in whole
steps quarters end 17, halves 10, and all of these in turn every one."""


@check_arguments
def replay(
    plan: Plan,
    scene: Scene,
    watch: Hooks | Callable[[Any], None] | None = None,
    parts_at: Poses | None = None,
    fidelity: str = "full",
    cache: ReplayCache | None = None,
    spiral: bool = False,
    most_s: float = math.inf,
    error: RobotError | None = None,
    probing: ProbingConfig | None = None,
) -> ReplayResult:
    """Carry out a plan.

    Args:
        watch: Called with the `MjData` about every 20 ms of simulated time; or several `Hooks`.
        parts_at: Where the parts really stand, world frame, [m]; by default where the plan believes them.
        fidelity: `full`, or `near-contact`: stretches of a motion on which nothing is near are left out. With a grasp by
            friction, what rests untouched sleeps in both.
        cache: What replays of this scene have in common; changes nothing but the time it takes.
        searches: The robot feels for a hole where a motion into it is stopped by force.
        most_s: Simulated time after which no step is begun; a schedule that takes longer for sure is not begun at all.
        error: What is wrong with the robot; it goes by the plan as if nothing were.
        feels: How a robot finds out what is wrong with it, by what it touches; None: it does not.
    """
    feeling = None if probing is None else ProbingState(probing, plan, scene, error)
    acts = () if probing is None else probing.acts
    prepared = partial(moves_of, plan, scene, spiral or "search" in acts, acts)
    start = plan.start if parts_at is None else parts_at
    if len(plan.schedule) * _SHORTEST_STEP_S > most_s:
        todo: tuple[Move, ...] = ()
        refused: Outcome | None = _outcome(plan, "plan", "time_limit", plan.schedule[0].operation)
    else:
        todo = prepared(error)
        refused = _refusal(plan, scene, todo)
    cache = ReplayCache() if cache is None or watch is not None or feeling is not None else cache
    keys = cache_keys(scene, start, fidelity, todo, error)
    same = None if refused or not keys or most_s < math.inf else cache.ended(keys[-1])
    if same is not None:
        return same
    hooks = hooks_of(watch)
    hooks.before_replay(plan)
    robot = Robot(scene, start, hooks, fidelity, error)
    progress = Progress([None] * len(plan.assembly), [])
    with sleeping(scene.work, scene.grasp == "friction"):
        outcome = refused or run_schedule(plan, robot, todo, progress, cache, keys, most_s, feeling, prepared)
        final = _settled(robot, plan) if outcome.code != "unstable_simulation" else None
    result = ReplayResult(
        reached=Reached(after=tuple(progress.after), final=final),
        outcome=outcome,
        peak_force_n=robot.forces.peak_n,
        sim_time_s=float(robot.data.time),
        timeline=tuple(progress.timeline),
        in_hand=robot.hold_watch.finished,
        felt=None if feeling is None else feeling.belief.found,
    )
    if keys and not refused and outcome.code != "time_limit":
        cache.end(keys[-1], result)
    return result


def moves_of(
    plan: Plan, scene: Scene, spiral: bool, acts: tuple[str, ...], error: RobotError | None
) -> tuple[Move, ...]:
    """The moves of a plan, as a robot carries them out whose base and tool are not where it believes them."""
    if error is None:
        return moves(plan, scene, spiral, acts)
    planned = moves(error.plan(plan), scene, spiral, acts)
    return tuple(Move(step, transfer.with_tip_at(error.tool)) for step, transfer in planned)


def _refusal(plan: Plan, scene: Scene, todo: tuple[Move, ...]) -> Outcome | None:
    """What is wrong with the plan before anything moves."""
    for upto, goals in poses_in_force(plan):
        k = first_unstable(plan.assembly.first(upto), plan.start, goals[:upto])
        if k is not None:
            return _outcome(plan, "plan", "unstable_goal", k)
    for step, transfer in todo:
        if code := key_angles(transfer, scene).code:
            return _outcome(plan, "plan", code, step.operation)
    return None


def run_schedule(
    plan: Plan,
    robot: Robot,
    todo: tuple[Move, ...],
    progress: Progress,
    cache: ReplayCache,
    keys: list[bytes],
    most_s: float,
    feeling: ProbingState | None,
    prepared: Callable[[RobotError | None], tuple[Move, ...]],
) -> Outcome:
    """One step of the schedule after the other, from the furthest state that the cache has.

    Args:
        prepared: What to do, by what is wrong with the robot and not made up for.
    """
    kept_states, grip = cache.resume(keys, robot, progress)
    if not kept_states:
        try:
            with robot.watch_stability():
                robot.wait(_AT_FIRST_S)
                if feeling is not None:
                    find_out(robot, feeling)
                    todo = prepared(feeling.residual)
        except Halt as halt:
            if halt.stage == "touch":
                why = f": {halt.why}" if halt.why else ""
                return Outcome("touch", halt.code, None, touching_sentence(halt.code, part=halt.part) + why)
            return _outcome(plan, "pick", halt.code, plan.schedule[0].operation, halt.part)
    for i, (step, transfer) in list(enumerate(todo))[kept_states // 2 :]:
        if robot.data.time > most_s:
            return _outcome(plan, "pick", "time_limit", step.operation)
        robot.step = step
        robot.hooks.before_step(step)
        try:
            with robot.watch_stability():
                if kept_states <= 2 * i:
                    grip = take(robot, transfer, again=feeling is not None and "square" in feeling.acts)
                    robot.slip(step.operation)
                    cache.keep(keys[2 * i], robot, grip, progress)
                lay = None
                if feeling is not None:
                    feeling.taken(step.operation)
                    if transfer.flush is not None:
                        lay = partial(lay_down, robot, feeling, step.operation)
                bring(robot, transfer, grip, lay)
                _note_hold(robot, step)
                until_rest(robot)
                reached = None if step.undo else snapshot(robot.scene.work, robot.data, plan.start)
        except Halt as halt:
            if halt.code != "unstable_simulation":
                _note_hold(robot, step)
            if halt.code == "force_stop" and not step.undo:
                progress.after[step.operation] = snapshot(robot.scene.work, robot.data, plan.start)
            return _outcome(plan, halt.stage, halt.code, step.operation, halt.part)
        progress.after[step.operation] = reached
        progress.timeline.append((step, float(robot.data.time)))
        cache.keep(keys[2 * i + 1], robot, 0, progress)
        robot.hooks.after_step(step)
    return Outcome("done", "ok", None, sentence("ok"))


def _note_hold(robot: Robot, step: Step) -> None:
    """Write down how the part moved in the hand; of an operation that is undone nothing."""
    watch = robot.hold_watch
    if watch.grasped is not None:
        watch = watch.release(robot.in_hand())
    robot.hold_watch = HoldWatch(finished=watch.finished) if step.undo else watch.finish(step.operation)


def until_rest(robot: Robot) -> None:
    """The arm stands by until nothing moves at two looks in a row, with bounded patience; then the judge looks.

    Meanwhile nothing sleeps: a stick in its slot that is put to sleep and wakes in turn would rock on. What still moves
    after a while is followed in parts of a step: where two boxes lie on each other in nearly one plane, the engine
    finds four points of contact at one depth and a single one at another, and steps of one length can keep a stick
    rocking between the two.
    """
    moving = np.array([np.arange(v, v + 6) for v in robot.scene.work.dof.values()])
    quiet = 0
    with sleeping(robot.scene.work, False):
        for i in range(round(PATIENCE_S / LOOK_S)):
            speed = np.abs(robot.data.qvel[moving]).max(axis=0)
            quiet = quiet + 1 if speed[:3].max() < _REST_M_S and speed[3:].max() < _REST_RAD_S else 0
            if quiet == 2:
                return
            robot.wait(LOOK_S, parts=next(parts for since, parts in _STEPS if i * LOOK_S >= since))


def _settled(robot: Robot, plan: Plan) -> Snapshot | None:
    try:
        with robot.watch_stability():
            robot.wait(_SETTLE_S)
            until_rest(robot)
    except Halt as halt:
        if halt.code == "unstable_simulation":
            return None
    return snapshot(robot.scene.work, robot.data, plan.start)


def _outcome(plan: Plan, stage: str, code: str, k: int, part: str = "") -> Outcome:
    return Outcome(stage, code, k, sentence(code, part=part or plan.assembly.operations[k].main, operation=k))
