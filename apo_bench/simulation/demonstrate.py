"""The human's demonstration, simulated: what the hands did, read off when each part rested."""

from __future__ import annotations

import numpy as np

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.judge import judge
from apo_bench.program import Demonstration, Layout, Reached, Snapshot
from apo_bench.scenario import Carelessness, Scenario
from apo_bench.simulation.hands import Hands
from apo_bench.simulation.paths import Line, at_height, minimum_jerk, moved, smooth
from apo_bench.simulation.scene import Scene
from apo_bench.simulation.world import snapshot, unstable

UP = np.array([0.0, 0.0, 1.0])
SPEED = 0.9
"""Peak speed of a hand that carries a part through the air, [m/s]."""
STROKE = 0.15
"""Peak speed of a hand that brings a part to its place, [m/s]."""
SAFE_M = 0.16
"""Height at which parts are carried over the others."""
DROP_M = 0.0002
"""A part is let go this much above its support, as nobody presses it into the table."""
LIFT_M = 0.0003
"""How far a part is lifted while it is adjusted, so that it does not drag the one below."""
REST_S = 0.3


def demonstrate(scene: Scene, layout: Layout, careless: float, rng: np.random.Generator) -> Demonstration:
    """Assemble by hand, with an error of `careless` times the scenario's carelessness.

    The error is put into the operation that the scenario names. At the last operation the other hand corrects it;
    that small motion shows in `final`, not in the goals, since nobody looked at that part again.

    Args:
        careless: 0 is a careful human, 1 the scenario's, any other number a multiple of it.
        rng: Drawn from in the same way whatever `careless` is, so that hands of one seed differ in size only.
    """
    scenario = scene.scenario
    error = _draw(scenario.careless, careless, rng)
    hands = Hands(scene.shown, layout.start)
    hands.wait(0.05)
    goals, after = [], []
    for k, operation in enumerate(scenario.assembly.operations):
        wrong = error if scenario.careless is not None and scenario.careless.operation == k else np.zeros(3)
        target = layout.goals[k] @ pose.exp(np.concatenate([wrong, np.zeros(3)]))
        last = k == len(scenario.assembly) - 1
        adjust = scenario.careless.operation if scenario.careless and last and error.any() else None
        _operate(hands, scenario, layout, k, target, adjust if adjust != k else None)
        after.append(snapshot(scene.shown, hands.data, layout.start))
        goals.append(after[-1].poses[operation.main])
    hands.wait(REST_S)
    final = snapshot(scene.shown, hands.data, layout.start)
    return Demonstration(
        assembly=scenario.assembly,
        start=layout.start,
        goals=np.array(goals),
        final=final.poses,
        careless=careless_covariance(scenario, careless),
        code="ok" if not unstable(hands.data) and _right(scene, layout, after, final) else "demonstration_failed",
    )


def careless_covariance(scenario: Scenario, careless: float) -> Array:
    """(n, 6, 6) [m^2]: the mean square error of the careless operation along its axis, zero elsewhere."""
    covariance = np.zeros((len(scenario.assembly), 6, 6))
    if scenario.careless is not None:
        axis = scenario.careless.axis
        rms = careless * scenario.careless.rms_m
        covariance[scenario.careless.operation, :3, :3] = rms**2 * np.outer(axis, axis)
    return covariance


def _draw(how: Carelessness | None, careless: float, rng: np.random.Generator) -> Array:
    """The offset of the careless operation, (3,) [m], in the part's own frame."""
    sign, size = rng.choice([-1.0, 1.0]), rng.uniform(0.0, 1.0)
    if how is None:
        return np.zeros(3)
    return careless * sign * (how.low_m + size * (how.high_m - how.low_m)) * how.axis


def _operate(hands: Hands, scenario: Scenario, layout: Layout, k: int, target: Array, adjust: int | None) -> None:
    part, attach = scenario.assembly.operations[k].main, scenario.attach[k]
    way = target[:3, :3] @ attach.direction
    before = moved(target, way, -attach.travel_m)
    T = hands.grab(0, part)
    safe = max(SAFE_M, before[2, 3])
    for end in (at_height(T, max(safe, T[2, 3])), at_height(before, safe), before):
        hands.move((0, smooth(T, end, SPEED, turn_speed=4.0)))
        T = end
    stop = moved(target, UP, DROP_M) if way[2] < -0.5 else target
    stroke = smooth(before, stop, STROKE)
    if adjust is None:
        hands.move((0, stroke))
        hands.wait(0.05)
    else:
        _insert_with_both(hands, scenario, layout, stroke, adjust)
    hands.let_go(0, part)
    hands.wait(REST_S)


def _insert_with_both(hands: Hands, scenario: Scenario, layout: Layout, stroke: Line, adjust: int) -> None:
    """One hand brings its part; the other lifts, shifts and lowers the careless part before the first arrives."""
    other = scenario.assembly.operations[adjust].main
    here = hands.grab(1, other)
    there = np.array(layout.goals[adjust])
    there[2, 3] = here[2, 3]
    hands.move((1, smooth(here, moved(here, UP, LIFT_M), 0.01)))
    hands.move((1, smooth(moved(here, UP, LIFT_M), moved(there, UP, LIFT_M), 0.03)), (0, _first(stroke, 0.15)))
    hands.move((1, smooth(moved(there, UP, LIFT_M), there, 0.01)))
    hands.move((0, smooth(_first(stroke, 0.15).end, stroke.end, STROKE)))
    hands.wait(0.05)
    hands.let_go(1, other)


def _first(stroke: Line, fraction: float) -> Line:
    """The first part of a stroke, as a motion of its own."""
    end = stroke.poses(np.array([fraction]))[0]
    return Line(stroke.start, end, stroke.seconds * 0.5, minimum_jerk)


def _right(scene: Scene, layout: Layout, after: list[Snapshot], final: Snapshot) -> bool:
    """Whether what the human built is right at the end; that late adjustments pushed a part is no fault."""
    verdict = judge(
        scene.scenario.assembly,
        Reached(after=tuple(after), final=final),
        layout.goals,
        scene.scenario.thresholds,
        scene.clearance_mm,
    )
    return not any(found for fault, found in verdict.conditions.items() if fault != "pushed")
