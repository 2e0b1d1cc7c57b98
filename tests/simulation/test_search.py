"""The search for a hole: what it finds where a peg is off, and where its path goes."""

from functools import cache

import numpy as np
import pytest

from apo_bench import Plan, build_scene, load_scenario
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.simulation.execution.search import RADIUS_M
from apo_bench.simulation.execution.search_laws import PITCH_M, Spiral
from apo_bench.simulation.robot.forces import Guard
from apo_bench.trial.trial_stages import replay_and_judge, simulate_demonstration

STEP_S = 0.001
DOWN = np.array([0.0, 0.0, -1.0])


@cache
def scene(name):
    return build_scene(load_scenario(name))


@cache
def shown(name):
    return simulate_demonstration(scene(name), 0.0, 1)


def layout(name):
    return shown(name).layout


def aside(name, mm):
    """The true plan, but for its last operation, which is this far off across the walls of its fit."""
    truth = layout(name)
    goals = np.array(layout(name).poses)
    goals[-1, :3, 3] += 1e-3 * mm * goals[-1, :3, 1]
    return Plan(scene(name).scenario.assembly, truth.start, goals)


def carried_out(plan, name, spiral, cache=None):
    return replay_and_judge(
        plan, scene(name), layout(name).poses, config=ExecutionConfig("near-contact", spiral), cache=cache
    )


def driven(law, push):
    """Where a law leads under a force that depends on where it has led, (k, 3)."""
    path = [np.zeros(3)]
    while (at := law(push(path[-1]))) is not None:
        path.append(at)
        assert len(path) < 100_000
    return np.array(path)


def test_a_peg_off_by_more_than_the_play_finds_its_hole_only_by_searching():
    name = "vanished_fixture"
    plan = aside("vanished_fixture", 0.6)
    blind, searched = (carried_out(plan, name, spiral) for spiral in (False, True))
    assert not blind.verdict.success
    assert searched.verdict.success
    assert searched.result.sim_time_s > blind.result.sim_time_s
    again = carried_out(plan, name, True)
    assert again.result.sim_time_s == searched.result.sim_time_s
    for part, T in searched.result.reached.final.poses.items():
        assert again.result.reached.final.poses[part].tobytes() == T.tobytes()


@pytest.mark.parametrize("direction", [DOWN, np.array([0.6, -0.8, 0.0])])
def test_a_spiral_covers_every_place(direction):
    press = 0.4
    path = driven(Spiral(Guard(direction, 2.0), press, RADIUS_M, 0.001, STEP_S), lambda _: -press * direction)
    assert np.abs(path @ direction).max() < 1e-5, "it advances until there is force"
    rng = np.random.default_rng(0)
    flat = path - (path @ direction)[:, None] * direction
    for _ in range(200):
        place = rng.normal(size=3)
        place -= (place @ direction) * direction
        place *= (RADIUS_M - PITCH_M) * np.sqrt(rng.random()) / np.linalg.norm(place)
        assert np.linalg.norm(flat - place, axis=1).min() < 0.55 * PITCH_M, "half the pitch, and a tenth for its steps"
    assert np.linalg.norm(flat, axis=1).max() < RADIUS_M + PITCH_M
