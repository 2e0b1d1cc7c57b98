"""What is called while hands demonstrate or a robot replays, and in which order."""

from itertools import groupby
from typing import Any

import numpy as np
import pytest

from apo_bench import Layout, Plan, Scene, build_scene, demonstrate, draw_layout, load_scenario, replay
from apo_bench.assembly import Step
from apo_bench.geometry import pose
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.simulation.hooks import BY_HAND, Hooks, Phase


class Calls:
    """Writes down what is called, one after the other."""

    def __init__(self) -> None:
        self.made: list[tuple[str, Any]] = []
        self.macros: set[str] = set()

    @property
    def hooks(self) -> Hooks:
        return Hooks(
            before_replay=lambda plan: self.made.append(("replay", plan)),
            before_step=lambda step: self.made.append(("before", step)),
            after_step=lambda step: self.made.append(("after", step)),
            after_tick=self._tick,
        )

    @property
    def order(self) -> list[tuple[str, Any]]:
        """What was called; ticks of one operation count once."""
        return [call for call, _ in groupby(self.made)]

    def _tick(self, data: Any, phase: Phase) -> None:
        self.made.append(("tick", phase.operation))
        self.macros.add(phase.macro)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return build_scene(load_scenario("block_on_block"))


@pytest.fixture(scope="module")
def layout(scene: Scene) -> Layout:
    return draw_layout(scene.scenario, np.random.default_rng(0), scene.clearance_mm)


BOTH_STEPS = [
    ("tick", None),
    *[("before", Step(0)), ("tick", 0), ("after", Step(0))],
    *[("before", Step(1)), ("tick", 1), ("after", Step(1))],
    ("tick", 1),
]


def test_a_replay_calls_its_hooks_before_and_after_each_step_and_each_tick(scene: Scene, layout: Layout) -> None:
    calls = Calls()
    plan = Plan(scene.scenario.assembly, layout.start, layout.poses)
    assert replay(plan, scene, calls.hooks, config=ExecutionConfig("near-contact")).outcome.code == "ok"
    assert calls.order == [("replay", plan), *BOTH_STEPS]


def test_a_demonstration_calls_the_same_hooks_but_for_that_of_the_plan(scene: Scene, layout: Layout) -> None:
    calls = Calls()
    demonstrate(scene, layout, 0.0, np.random.default_rng(1), calls.hooks)
    assert calls.order == BOTH_STEPS
    assert calls.macros == {BY_HAND}


def test_a_step_that_fails_has_no_end(scene: Scene, layout: Layout) -> None:
    """The first part stands 40 mm beside where the plan has it, and the fingers close on nothing."""
    calls = Calls()
    plan = Plan(scene.scenario.assembly, layout.start, layout.poses)
    first = scene.scenario.assembly.operations[0].main
    aside = {**layout.start, first: pose.at((0.0, 0.04, 0.0)) @ layout.start[first]}
    assert replay(plan, scene, calls.hooks, parts_at=aside, config=ExecutionConfig("near-contact")).outcome.code != "ok"
    assert calls.order == [("replay", plan), ("tick", None), ("before", Step(0)), ("tick", 0)]
