"""The range finder in the simulation: it changes nothing, sees no hands, waits for quiet, recognises, locates."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from apo_bench import Observation, Scene, TrialConfig, build_scene, load_scenario, run_trial
from apo_bench.geometry import Array, pose
from apo_bench.perception.depth_camera.range_finder import VIEWS
from apo_bench.simulation.human.hands import Hands
from apo_bench.simulation.sensor.rays import ModelRays, Sight
from apo_bench.trial.trial_stages import (
    SimulatedDemonstration,
    observe_demonstration,
    range_sensor,
    simulate_demonstration,
)

TWO = ("stick_in_tower", "carried_bridge")


@cache
def scene(name: str) -> Scene:
    return build_scene(load_scenario(name))


@cache
def _watched(name: str, seed: int) -> SimulatedDemonstration:
    return simulate_demonstration(scene(name), 1.0, seed, "depth-camera")


def watched(name: str, seed: int = 3) -> SimulatedDemonstration:
    return _watched(name, seed)


def observed(name: str, noise_mm: float, seed: int = 3) -> Observation:
    simulated = watched(name, seed)
    return observe_demonstration(simulated, range_sensor(scene(name), simulated, noise_mm), seed)


def errors(name: str, seen: Observation, seed: int = 3) -> Array:
    """Body twists, (n, 6), by which seen goals are away from shown ones, [mm, deg]."""
    xi = pose.log(pose.inverse(seen.poses) @ watched(name, seed).demonstration.poses)
    return np.hstack([1e3 * xi[:, :3], np.degrees(xi[:, 3:])])


@pytest.mark.parametrize("name", TWO)
def test_being_watched_changes_nothing(name: str) -> None:
    alone = simulate_demonstration(scene(name), 1.0, 3).demonstration
    seen = watched(name).demonstration
    assert alone.poses.tobytes() == seen.poses.tobytes()
    assert {part: T.tobytes() for part, T in alone.final.items()} == {
        part: T.tobytes() for part, T in seen.final.items()
    }


def test_a_scene_and_the_models_of_its_parts_look_the_same_and_no_hands_are_seen() -> None:
    built = scene("stick_in_tower")
    start = watched("stick_in_tower").layout.start
    hands = Hands(built, start)
    hands.grab(0, "stick")  # the ball that holds it is thicker than the stick
    sight = Sight(built.shown)
    sight.look(hands.data.qpos)
    image = sight.range_image()
    solids = built.scenario.assembly.solids
    models = ModelRays(solids, 1e-3 * built.clearance_mm)
    poses = {part: start[part] for part in solids}
    for view, distance in zip(VIEWS, image.distance, strict=True):
        expected = models(poses, view.origin, view.rays)[0].reshape(distance.shape)
        both = np.isfinite(expected)
        assert (np.isfinite(distance) == both).mean() > 0.9999
        both &= np.isfinite(distance)
        assert (np.abs(distance[both] - expected[both]) < 1e-9).mean() > 0.999  # rays along an edge may go either way
    assert (image.cosine >= 0.0).all()
    assert image.cosine.max() <= 1.0 + 1e-12


@pytest.mark.parametrize("name", TWO)
def test_parts_are_located_within_half_a_millimetre_and_a_degree(name: str) -> None:
    seen = observed(name, 1.0)
    off = errors(name, seen)
    assert seen.observed.all()
    assert np.median(np.linalg.norm(off[:, :3], axis=1)) < 0.5
    assert np.median(np.linalg.norm(off[:, 3:], axis=1)) < 1.0
    eigenvalues = np.linalg.eigvalsh(seen.covariance)
    assert (eigenvalues > 0.0).all()


def test_an_operation_that_no_image_shows_is_not_seen() -> None:
    simulated = watched("stick_in_tower")
    pose_source = range_sensor(scene("stick_in_tower"), simulated, 1.0)
    blind = replace(pose_source, images=pose_source.images[:2])
    seen = observe_demonstration(simulated, blind, 3)
    assert seen.observed.tolist() == [True, False, False]
    none = replace(pose_source, images=pose_source.images[:1])
    assert not observe_demonstration(simulated, none, 3).observed.any()


def test_a_trial_through_the_range_finder() -> None:
    spec = TrialConfig("stick_in_tower", noise_mm=1.0, pose_source="depth-camera", method="contact", seed=3)
    row = run_trial(spec, scene("stick_in_tower"), simulated=watched("stick_in_tower"))
    assert row["pose_source"] == "depth-camera"
    assert row["success"] is True
