"""The human's demonstration, simulated: what the hands did, read off when each part rested.

What two hands do in one operation: take, carry over the others, bring to its place, let go.

`act` says from the scenario what is to be done, `perform` does it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, final

import mujoco
import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Assembly, Demonstration, Layout, Poses, Reached, Snapshot, placements
from apo_bench.geometry import Array, pose
from apo_bench.judging.verdict import judge
from apo_bench.planning.insertion.arrival import Arrival
from apo_bench.planning.insertion.macros import UP
from apo_bench.planning.insertion.surroundings import OVER_M, ends_of, slide_directions
from apo_bench.records import sentence
from apo_bench.scenario import (
    HumanError,
    Scenario,
    human_error_covariance,
    nominal_operations,
    spread_error,
)
from apo_bench.scenario.human_error import ErrorSpread
from apo_bench.simulation.hooks import Hooks
from apo_bench.simulation.human.hands import Hands, PartLost
from apo_bench.simulation.robot import Trajectory, minimum_jerk, shifted, smooth, with_height
from apo_bench.simulation.scene import Scene, has_failed, is_unstable, sleeping, snapshot

_SIDE_M = 0.002
"""A part comes down this far beside one that it will lie against, and leaves it by as much before it is lifted."""
_SPEED = 0.9
"""Peak speed of a hand that carries a part through the air, [m/s]."""
_STROKE = 0.15
"""Peak speed of a hand that brings a part to its place, [m/s]."""
_SHIFT = 0.03
"""Peak speed of a small adjustment, and of coming to lie against another part, [m/s]."""
_NUDGE = 0.01
"""Peak speed of lifting and lowering a part for an adjustment, [m/s]."""
_SAFE_M = 0.16
"""Least height at which parts are carried over the others."""
_DROP_M = 0.0002
"""A part is let go this much above its support, as nobody presses it into the table."""
_LIFT_M = 0.0003
"""How far a part is lifted while it is adjusted, so that it does not drag the one below."""
STAND_STILL_S = 0.3
_SETTLE_S = 0.15
"""A group trails behind a quick hand by a millimetre; so long it takes to catch up."""


@final
@dataclass(frozen=True, eq=False)
class Act:
    """One operation as the hands do it; poses and directions in the world, [m]."""

    part: str
    carries: tuple[str, ...]
    target: Array
    """(4, 4), of the part."""
    way: Array
    """Unit vector of the last motion, (3,)."""
    travel: float
    out: Array
    """(3,), the first motion: away from what the part lies against or sticks in; zero: straight up."""
    aside: Array
    """(3,), how far beside its target it comes down; zero if it comes to lie against nothing."""
    true: Poses
    """Where every part should be when all is done."""
    bearing: tuple[str, ...]
    """The moved parts that make contacts."""
    over: float
    """How high the part must be lifted so that what moves passes over what stands, [m]."""
    drags: bool
    """Whether it comes level, over a floor to which it has no play."""
    late: tuple[str, ...]
    """Parts that are displaced and now brought to their true places by the other hand."""

    @property
    def from_above(self) -> bool:
        return bool(self.way[2] < -0.5)


def act(scenario: Scenario, k: int, target: Array, stages: tuple[Poses, ...], late: tuple[str, ...]) -> Act:
    """Operation k for the hands.

    Args:
        target: (4, 4), where the hands put the main part, right or wrong.
        stages: Where every part should be before the first operation and after each.
        late: Displaced parts that the other hand corrects.
    """
    assembly = scenario.assembly
    operation = assembly.operations[k]
    nominal = nominal_operations(scenario)[k]
    way = target[:3, :3] @ nominal.after.line.direction
    on_floor = any(each.normal[2] > 0.5 and not assembly.play(each.contact, 1.0) for each in nominal.after.touched)
    top, bottom = ends_of(assembly, operation.moves, stages[k])
    beside = _off(slide_directions(assembly, nominal.after, stages[k + 1]))
    return Act(
        part=operation.main,
        carries=operation.carries,
        target=target,
        way=way,
        travel=nominal.after.line.travel_m,
        out=_out(assembly, nominal.before, stages[k]),
        aside=_SIDE_M * beside if way[2] < -0.5 else np.zeros(3),
        true=stages[k + 1],
        bearing=tuple(dict.fromkeys(contact.manipulated.part for contact in operation.contacts)),
        over=top + (float(stages[k][operation.main][2, 3]) - bottom) + OVER_M,
        drags=abs(way[2]) < 0.5 and on_floor,
        late=late,
    )


def _out(assembly: Assembly, before: Arrival, poses: Poses) -> Array:
    """The motion, (3,) [m], that frees what moves: back out of where it sticks, or off what is beside."""
    way = poses[before.main][:3, :3] @ before.line.direction
    if before.touched and abs(way[2]) < 0.5:
        return np.asarray(-before.line.travel_m * way)
    return _SIDE_M * _off(slide_directions(assembly, before, poses))


def _off(sides: tuple[Array, ...]) -> Array:
    """Away from all of them, (3,); zero if there is none."""
    return -np.sum(np.array(sides).reshape(-1, 3), axis=0)


def perform(hands: Hands, act: Act, clearance_m: float) -> None:
    """Carry it out, and wait until everything rests."""
    T = hands.grab(0, act.part)
    for part in act.carries:
        hands.add(0, part)
    before, beside, goal = _ends(hands, act, T, clearance_m)
    if act.out.any():
        T = _free(hands, T, act.out, clearance_m)
    safe = max(_SAFE_M, act.over, before[2, 3])
    for end in (with_height(T, max(safe, T[2, 3])), with_height(before, safe), before):
        hands.move((0, smooth(T, end, _SPEED, turn_speed=4.0)))
        T = end
    for part in (part for part in act.late if part in act.carries):
        hands.wait(_SETTLE_S)
        _shift_carried(hands, act, part, clearance_m)
    _bring(hands, act, smooth(before, beside, _STROKE))
    if act.aside.any():
        hands.move((0, smooth(beside, goal, _SHIFT)))
        hands.wait(0.05)
    hands.let_go(0, act.part, *act.carries)
    hands.wait(STAND_STILL_S)


def _free(hands: Hands, T: Array, out: Array, clearance_m: float) -> Array:
    """Move level off or out of something, raised off the floor of a hole that would be dragged along."""
    raised = shifted(T, UP, clearance_m)
    hands.move((0, smooth(T, raised, _NUDGE)))
    hands.move((0, smooth(raised, shifted(raised, out, 1.0), _STROKE)))
    return shifted(raised, out, 1.0)


def _ends(hands: Hands, act: Act, T: Array, clearance_m: float) -> tuple[Array, Array, Array]:
    """Where the last motion begins, where it ends beside the goal, and the pose at which the part is let go.

    Over a floor without play the part is held up by half the clearance, as friction would hold it back.
    """
    goal = target = shifted(act.target, UP, clearance_m / 2) if act.drags else act.target
    if act.from_above:
        goal = shifted(act.target, UP, _DROP_M + (_rise(hands, act, T) if act.carries else 0.0))
    beside = shifted(goal, act.aside, 1.0) if act.aside.any() else goal
    return shifted(shifted(target, act.way, -act.travel), act.aside, 1.0), beside, goal


def _rise(hands: Hands, act: Act, T: Array) -> float:
    """How much higher a group must end than planned, as it hangs in the hand, so that nothing ends too deep, [m]."""
    way = act.target @ pose.inverse(T)
    return max(float(act.true[part][2, 3] - (way @ hands.pose(part))[2, 3]) for part in act.bearing)


def _bring(hands: Hands, act: Act, stroke: Trajectory) -> None:
    """The last motion; the other hand adjusts what is displaced on the way, the last of it while the part arrives."""
    standing = [part for part in act.late if part not in act.carries]
    for part in standing[:-1]:
        _adjust(hands, part, act.true[part], _LIFT_M, ())
        hands.let_go(1, part)
    if standing:
        _adjust(hands, standing[-1], act.true[standing[-1]], _LIFT_M, ((0, _first(stroke, 0.15)),))
        hands.move((0, smooth(_first(stroke, 0.15).end, stroke.end, _STROKE)))
    else:
        hands.move((0, stroke))
    hands.wait(0.05)
    hands.let_go(1, *standing[-1:])


def _shift_carried(hands: Hands, act: Act, part: str, clearance_m: float) -> None:
    """Shift a part of the group to its true place beside the main part; lowered, so that it does not rub."""
    there = hands.pose(act.part) @ pose.inverse(act.true[act.part]) @ act.true[part]
    _adjust(hands, part, there, -clearance_m, (), held=True)
    hands.wait(0.05)
    hands.add(0, part)
    hands.let_go(1, part)


def _adjust(
    hands: Hands, part: str, true: Array, lift: float, meanwhile: tuple[tuple[int, Trajectory], ...], held: bool = False
) -> None:
    """Lift, shift and lower a part to its true place at the height where it is; the hand then still holds it."""
    here = hands.grab(1, part)
    if held:
        hands.let_go(0, part)
    there = with_height(true, here[2, 3])
    hands.move((1, smooth(here, shifted(here, UP, lift), _NUDGE)))
    hands.move((1, smooth(shifted(here, UP, lift), shifted(there, UP, lift), _SHIFT)), *meanwhile)
    hands.move((1, smooth(shifted(there, UP, lift), there, _NUDGE)))


def _first(stroke: Trajectory, fraction: float) -> Trajectory:
    """The first part of a stroke, as a motion of its own."""
    return Trajectory(stroke.start, stroke.poses(np.array([fraction]))[0], stroke.seconds * 0.5, minimum_jerk)


@check_arguments
def demonstrate(
    scene: Scene,
    layout: Layout,
    human_error: float,
    rng: np.random.Generator,
    watch: Hooks | Callable[[Any], None] | None = None,
) -> Demonstration:
    """Assemble by hand, with an error of `human_error` times the scenario's carelessness.

    The error is put into the operation that the scenario names, and parts that are put against a displaced one follow
    it. At the last operation the other hand corrects all of them; those small motions show in `final`, not in the
    goals, since nobody looked at these parts again.

    Args:
        human_error: 0 is a careful human, 1 the scenario's, any other number a multiple of it.
        rng: Drawn from in the same way whatever `human_error` is, so that hands of one seed differ in size only.
        watch: Called with the `MjData` at the start and every `period_s` of simulated time, an attribute of it, by
            default 20 ms; or several `Hooks`. The demonstration is the same with and without it.
    """
    scenario = scene.scenario
    error = spread_error(scenario, layout, _draw(scenario.human_error, human_error, rng))
    hands = Hands(scene, layout.start, watch)
    try:
        after = _assemble(scene, layout, hands, error)
    except (PartLost, mujoco.FatalError, ArithmeticError, ValueError) as failure:
        if not isinstance(failure, PartLost) and not is_unstable(failure, hands.data):
            raise
        after = []
    if not after or has_failed(hands.data):
        # Where the parts are is not known any more, and nobody asks.
        why, goals, final = "the simulation became unstable", layout.poses, layout.start
    else:
        why = _wrong(scene, layout, after)
        mains = [operation.main for operation in scenario.assembly.operations]
        goals = np.array([reached.poses[main] for reached, main in zip(after, mains, strict=False)])
        final = after[-1].poses
    return Demonstration(
        assembly=scenario.assembly,
        start=layout.start,
        poses=goals,
        final=final,
        human_error_covariance=human_error_covariance(scenario, human_error),
        code="demonstration_failed" if why else "ok",
        why=why,
        gap_m=1e-3 * scenario.gap_mm,
        play_m=1e-3 * scene.clearance_mm,
    )


def _assemble(scene: Scene, layout: Layout, hands: Hands, error: ErrorSpread) -> list[Snapshot]:
    """Do all operations; what stands where after each, and when all is done."""
    scenario = scene.scenario
    stages = (layout.start, *placements(scenario.assembly, layout.start, layout.poses))
    after = []
    with sleeping(scene.shown, True):
        hands.wait(0.05)
        for k in range(len(scenario.assembly)):
            hands.begin(k)
            target = layout.poses[k] @ pose.exp(np.concatenate([error.offsets[k], np.zeros(3)]))
            late = error.left if k == len(scenario.assembly) - 1 else ()
            perform(hands, act(scenario, k, target, stages, late), 1e-3 * scene.clearance_mm)
            after.append(snapshot(scene.shown, hands.data, layout.start))
            hands.end(k)
        hands.wait(STAND_STILL_S)
    return [*after, snapshot(scene.shown, hands.data, layout.start)]


def _draw(how: HumanError | None, human_error: float, rng: np.random.Generator) -> Array:
    """The offset of the careless operation, (3,) [m], in the part's own frame."""
    sign = rng.choice([-1.0, 1.0])
    size = rng.uniform(0.0, 1.0)
    if how is None:
        return np.zeros(3)
    return human_error * sign * (how.low_m + size * (how.high_m - how.low_m)) * how.axis


def _wrong(scene: Scene, layout: Layout, after: list[Snapshot]) -> str:
    """What is wrong with what the human built, empty if nothing is; that late adjustments pushed a part is no fault."""
    reached = Reached(after=tuple(after[:-1]), final=after[-1])
    demonstrated = judge(scene.scenario.assembly, reached, layout.poses, scene.criteria).demonstrated
    fault = next((fault for fault, there in demonstrated.conditions.items() if there and fault != "pushed"), None)
    if fault is None:
        return ""
    bad = next((c for c in demonstrated.contacts if not c.strict), None)
    where = f" ({bad.contact}, operation {bad.operation + 1})" if bad and fault in ("gap", "overlap") else ""
    return sentence(fault) + where
