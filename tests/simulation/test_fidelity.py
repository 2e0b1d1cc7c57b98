"""Fidelity `near-contact` skips only free motion, and cached beginnings change nothing."""

import json
from functools import cache

import numpy as np
import pytest

from apo_bench import Plan, TrialConfig, build_scene, load_scenario, replay, run_trial
from apo_bench.geometry import measure_intrusion_depths, pose
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.simulation.execution.replay_cache import ReplayCache
from apo_bench.simulation.robot import obstacles
from apo_bench.simulation.robot.paths import Trajectory, translate
from apo_bench.simulation.scene.world import make_initial_state
from apo_bench.trial.trial_stages import simulate_demonstration


@cache
def _scene(name, grasp):
    return build_scene(load_scenario(name), grasp=grasp)


@cache
def _shown(name, grasp, seed, human_error_scale):
    return simulate_demonstration(scene(name, grasp), human_error_scale, seed)


def scene(name="stick_in_tower", grasp="friction"):
    return _scene(name, grasp)


def shown(name="stick_in_tower", grasp="friction", seed=1, human_error_scale=1.0):
    return _shown(name, grasp, seed, human_error_scale)


def row(method, fidelity, *, grasp="friction", noise_level=1.0, cache=None):
    spec = TrialConfig(
        "stick_in_tower", noise_level, noise_level, grasp=grasp, method=method, seed=1, fidelity=fidelity
    )
    return json.dumps(run_trial(spec, scene(grasp=grasp), simulated=shown(grasp=grasp), cache=cache))


RUNS = [("paper-track", 1.0), ("uncorrected", 1.0), ("paper", 0.5), ("paper-track", 1.0)]


@pytest.mark.parametrize(
    ("fidelity", "grasp", "runs"), [("near-contact", "friction", RUNS), ("full", "weld", [*RUNS[:2], RUNS[-1]])]
)
def test_cached_beginnings_change_no_byte(fidelity, grasp, runs):
    cache = ReplayCache()
    shared = [row(method, fidelity, grasp=grasp, noise_level=level, cache=cache) for method, level in runs]
    alone = [row(method, fidelity, grasp=grasp, noise_level=level) for method, level in runs[:-1]]
    assert shared == [*alone, alone[0]]


def test_near_contact_takes_as_much_simulated_time():
    layout = shown().layout
    plan = Plan(scene().scenario.assembly, layout.start, layout.poses)
    full, contact = (replay(plan, scene(), config=ExecutionConfig(fidelity)) for fidelity in ("full", "near-contact"))
    assert full.outcome.code == contact.outcome.code == "ok"
    assert contact.sim_time_s == pytest.approx(full.sim_time_s, abs=0.5)
    for part, T in full.reached.final.poses.items():
        assert contact.reached.final.poses[part] == pytest.approx(T, abs=1e-3), f"{part}: more than it drifts in a hand"


def test_no_turn_that_comes_near_anything_is_skipped():
    its = scene()
    rng = np.random.default_rng(5)
    data = make_initial_state(its.work, shown().layout.start)
    others = [part for part in (*its.work.free, *its.work.fixed) if part != "stick"]
    hand = [obstacles.MovingPieces(its.pieces["stick"], np.eye(4))]
    came = 0
    skipped = 0
    for _ in range(60):
        start = pose.at(rng.uniform((-0.1, -0.1, 0.03), (0.1, 0.1, 0.2)), rng.uniform(-30.0, 30.0, 3))
        end = translate(start, rng.normal(size=3), 0.05) @ pose.at((0.0, 0.0, 0.0), rng.uniform(-30.0, 30.0, 3))
        line = Trajectory(start, end, 0.2, np.asarray)
        s = np.linspace(0.0, 1.0, 201)
        spans = obstacles.find_near_spans(its, data, hand, ("stick",), line, s)
        for i, T in enumerate(line.poses(s)):
            depths = [
                measure_intrusion_depths(
                    its.pieces["stick"],
                    T[:3, :3],
                    T[None, :3, 3],
                    its.pieces[part],
                    obstacles._pose(its.work, data, part),
                )
                for part in others
            ]
            is_near = np.max(depths) > -obstacles.NEAR_HELD_M[0]
            came += is_near
            skipped += not any(begin <= i <= end for begin, end in spans)
            assert not is_near or any(begin <= i <= end for begin, end in spans)
    assert came > 500
    assert skipped > 500
