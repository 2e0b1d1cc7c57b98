"""The human's demonstration, simulated: what the hands did, read off when each part rested."""

from collections.abc import Callable
from typing import Any

import numpy as np

from apo_bench.assembly import Demonstration, Layout, Reached, Snapshot, placements
from apo_bench.geometry import Array, pose
from apo_bench.judging.verdict import judge
from apo_bench.records import sentence
from apo_bench.scenario import Carelessness, careless_covariance, spread_error
from apo_bench.simulation.hooks import Hooks
from apo_bench.simulation.human.hands import Hands
from apo_bench.simulation.human.perform import STAND_STILL_S, act, perform
from apo_bench.simulation.scene import Scene, has_failed, left_out, sleeping, snapshot


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
    error = spread_error(scenario, layout, _draw(scenario.careless, human_error, rng))
    stages = (layout.start, *placements(scenario.assembly, layout.start, layout.goals))
    hands = Hands(scene, layout.start, watch)
    goals = []
    after = []
    with sleeping(scene.shown, True), left_out(scene.shown):
        hands.wait(0.05)
        for k, operation in enumerate(scenario.assembly.operations):
            hands.begin(k)
            target = layout.goals[k] @ pose.exp(np.concatenate([error.offsets[k], np.zeros(3)]))
            late = error.left if k == len(scenario.assembly) - 1 else ()
            perform(hands, act(scenario, k, target, stages, late), 1e-3 * scene.clearance_mm)
            after.append(snapshot(scene.shown, hands.data, layout.start))
            goals.append(after[-1].poses[operation.main])
            hands.end(k)
        hands.wait(STAND_STILL_S)
    final = snapshot(scene.shown, hands.data, layout.start)
    why = "the simulation became unstable" if has_failed(hands.data) else _wrong(scene, layout, after, final)
    return Demonstration(
        assembly=scenario.assembly,
        start=layout.start,
        goals=np.array(goals),
        final=final.poses,
        careless=careless_covariance(scenario, human_error),
        code="demonstration_failed" if why else "ok",
        why=why,
        gap_m=1e-3 * scenario.gap_mm,
        play_m=1e-3 * scene.clearance_mm,
    )


def _draw(how: Carelessness | None, human_error: float, rng: np.random.Generator) -> Array:
    """The offset of the careless operation, (3,) [m], in the part's own frame."""
    sign = rng.choice([-1.0, 1.0])
    size = rng.uniform(0.0, 1.0)
    if how is None:
        return np.zeros(3)
    return human_error * sign * (how.low_m + size * (how.high_m - how.low_m)) * how.axis


def _wrong(scene: Scene, layout: Layout, after: list[Snapshot], final: Snapshot) -> str:
    """What is wrong with what the human built, empty if nothing is; that late adjustments pushed a part is no fault."""
    reached = Reached(after=tuple(after), final=final)
    demonstrated = judge(scene.scenario.assembly, reached, layout.goals, scene.criteria).demonstrated
    fault = next((fault for fault, there in demonstrated.conditions.items() if there and fault != "pushed"), None)
    if fault is None:
        return ""
    bad = next((c for c in demonstrated.contacts if not c.strict), None)
    where = f" ({bad.contact}, operation {bad.operation + 1})" if bad and fault in ("gap", "overlap") else ""
    return sentence(fault) + where
