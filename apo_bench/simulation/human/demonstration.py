"""Simulate the demonstration of a human, and read the pose of each part once it rests."""

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.assembly import Demonstration, Layout, ReachedState, Snapshot, compute_placements
from apo_bench.geometry import Array, pose
from apo_bench.judging.verdict import judge
from apo_bench.records import describe_outcome
from apo_bench.scenario import (
    HumanError,
    compute_human_error_covariance,
    spread_error,
)
from apo_bench.scenario.human_error import ErrorSpread
from apo_bench.simulation.hooks import Hooks
from apo_bench.simulation.human.hands import Hands, PartLost
from apo_bench.simulation.human.operation import plan_hand_operation
from apo_bench.simulation.human.performing import STAND_STILL_S, perform
from apo_bench.simulation.scene import Scene, allow_sleep, has_failed, is_unstable, take_snapshot


@check_arguments
def demonstrate(
    scene: Scene,
    layout: Layout,
    human_error: float,
    rng: np.random.Generator,
    watch: Hooks | Callable[[Any], None] | None = None,
) -> Demonstration:
    """Simulate the demonstration by a human, with the human error of the scenario times `human_error`.

    The operation that the scenario names has the error, and parts that are placed against its part follow it. At the
    last operation the other hand corrects all of them; these small motions show in `final`, not in `poses`, since these
    parts are not observed again.

    Args:
        scene: From `build_scene`.
        layout: From `draw_layout`.
        human_error: 0 is an ideal human, 1 the human error of the scenario, another number a multiple of it.
        rng: The same numbers are drawn whatever `human_error` is, so that errors of one seed differ in size only.
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
        # Where the parts are is not known any more.
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
        human_error_covariance=compute_human_error_covariance(scenario, human_error),
        code="demonstration_failed" if why else "ok",
        why=why,
        gap_m=1e-3 * scenario.gap_mm,
        play_m=1e-3 * scene.clearance_mm,
    )


def _assemble(scene: Scene, layout: Layout, hands: Hands, error: ErrorSpread) -> list[Snapshot]:
    """Carry out all operations.

    Returns:
        A snapshot after each operation, and one at the end.
    """
    scenario = scene.scenario
    stages = (layout.start, *compute_placements(scenario.assembly, layout.start, layout.poses))
    after = []
    with allow_sleep(scene.shown, True):
        hands.wait(0.05)
        for k in range(len(scenario.assembly)):
            hands.begin(k)
            target = layout.poses[k] @ pose.exp(np.concatenate([error.offsets[k], np.zeros(3)]))
            # Displaced parts are corrected at the last operation.
            late = error.left if k == len(scenario.assembly) - 1 else ()
            perform(hands, plan_hand_operation(scenario, k, target, stages, late), 1e-3 * scene.clearance_mm)
            after.append(take_snapshot(scene.shown, hands.data, layout.start))
            hands.end(k)
        hands.wait(STAND_STILL_S)
    return [*after, take_snapshot(scene.shown, hands.data, layout.start)]


def _draw(how: HumanError | None, human_error: float, rng: np.random.Generator) -> Array:
    """The displacement of the operation with the human error, (3,), [m], in the frame of its part.

    The same random numbers are drawn whatever `how` and `human_error` are.
    """
    sign = rng.choice([-1.0, 1.0])
    size = rng.uniform(0.0, 1.0)
    if how is None:
        return np.zeros(3)
    return human_error * sign * (how.low_m + size * (how.high_m - how.low_m)) * how.axis


def _wrong(scene: Scene, layout: Layout, after: list[Snapshot]) -> str:
    """The fault of a demonstration in words; empty if it is right.

    Parts pushed by late corrections are no fault.
    """
    reached = ReachedState(after=tuple(after[:-1]), final=after[-1])
    demonstrated = judge(scene.scenario.assembly, reached, layout.poses, scene.criteria).demonstrated
    fault = next((fault for fault, there in demonstrated.conditions.items() if there and fault != "pushed"), None)
    if fault is None:
        return ""
    bad = next((c for c in demonstrated.contacts if not c.strict), None)
    where = f" ({bad.contact}, operation {bad.operation + 1})" if bad and fault in ("gap", "overlap") else ""
    return describe_outcome(fault) + where
