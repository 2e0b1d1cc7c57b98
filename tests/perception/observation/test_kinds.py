"""What each noise model is about, beyond the laws that all obey."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from apo_bench import Demonstration, Observation, draw_layout, load_scenario, observe
from apo_bench.geometry import Array, pose
from apo_bench.perception.observation.models import shared_bias as shared
from apo_bench.perception.observation.models.camera import Camera
from apo_bench.perception.observation.models.line_of_sight import CameraNoise
from apo_bench.perception.observation.models.outliers import (
    MISSES,
    OUTLIER_TIMES,
    OUTLIERS,
    UNOBSERVED_DEVIATION,
    OutlierNoise,
)
from apo_bench.perception.observation.models.shared_bias import CORRELATION, CorrelatedNoise, ViewBiasNoise
from apo_bench.perception.observation.models.symmetric_parts import FACTOR, SymmetricNoise
from apo_bench.perception.observation.noise import Noise, NoiseLevel
from tests import scenes

NOISE_LEVEL = NoiseLevel(2.0, 2.0)
CYCLE = scenes.turned(scenes.subassembly_on_castles(), pose.at((0.1, -0.02, 0.0), (0.0, 0.0, 23.0)))


def see(noise: Noise, seed: int, scene: scenes.Scene = CYCLE) -> Observation:
    return observe(scenes.shown(scene), noise, np.random.default_rng(seed))


def twists(seen: Observation, scene: scenes.Scene = CYCLE) -> Array:
    return pose.log(pose.inverse(scene.nominal_poses) @ seen.poses)


def test_a_camera_errs_along_its_rays_by_what_it_was_asked_to() -> None:
    """Positions that were seen, in the frames of the true rays: what the twist does to them is not used."""
    camera = Camera(pose.at((0.5, -0.4, 0.6), (-140.0, 10.0, 50.0)))
    noise = CameraNoise(NoiseLevel(1.0, 1.0), camera=camera, across=0.4, along=5.0, tilt=0.2, about=3.0)
    offsets = []
    turns = []
    for seed in range(600):
        goals = see(noise, seed).poses
        F = camera.frames(CYCLE.nominal_poses)
        offsets.append(np.einsum("nji,nj->ni", F, goals[:, :3, 3] - CYCLE.nominal_poses[:, :3, 3]))
        w = pose.log(goals @ pose.inverse(CYCLE.nominal_poses))[:, 3:]
        turns.append(np.einsum("nji,nj->ni", F, w))
    rms = [np.sqrt(np.mean(np.concatenate(some) ** 2, axis=0)) for some in (offsets, turns)]
    assert_allclose(rms[0] * 1e3, [0.4, 0.4, 5.0], rtol=0.05)
    assert_allclose(np.degrees(rms[1]), [0.2, 0.2, 3.0], rtol=0.05)


@cache
def outlying(trials: int = 1200) -> tuple[Array, Array, Array]:
    """Errors in units of the level, whether they are outliers by construction, and whether they were seen."""
    sigma = np.repeat([2e-3, np.radians(2.0)], 3)
    unit = []
    gross = []
    seen = []
    for seed in range(trials):
        made = see(OutlierNoise(NOISE_LEVEL), seed)
        rng = np.random.default_rng(seed)
        rng.standard_normal((5, 6))
        gross.append(rng.random((5, 2))[:, 0] < OUTLIERS)
        unit.append(twists(made) / sigma)
        seen.append(made.observed)
    return np.concatenate(unit), np.concatenate(gross), np.concatenate(seen)


def test_outliers_and_misses_are_as_frequent_and_as_large_as_declared() -> None:
    unit, gross, seen = outlying()
    n = len(unit)
    for share, found in ((OUTLIERS, gross.mean()), (MISSES, 1 - seen.mean())):
        assert abs(found - share) < 5 * np.sqrt(share * (1 - share) / n)
    for chosen, times in ((seen & ~gross, 1.0), (seen & gross, OUTLIER_TIMES)):
        rms = np.sqrt(np.mean(unit[chosen] ** 2))
        assert abs(rms / times - 1) < 5 / np.sqrt(12 * chosen.sum())


def test_a_missed_operation_tells_nothing_of_where_its_part_went() -> None:
    """Move what is missed elsewhere: the observation stays the same, to the bit."""
    seed = next(s for s in range(200) if not see(OutlierNoise(NOISE_LEVEL), s).observed.all())
    here = see(OutlierNoise(NOISE_LEVEL), seed)
    k = int(np.argmin(here.observed))
    goals = CYCLE.nominal_poses.copy()
    goals[k] = goals[k] @ pose.at((0.1, 0.2, 0.3), (10.0, 20.0, 30.0))
    there = see(OutlierNoise(NOISE_LEVEL), seed, scenes.Scene(CYCLE.assembly, CYCLE.start, goals))
    assert here.poses.tobytes() == there.poses.tobytes()
    assert_array_equal(here.covariance, there.covariance)
    assert_allclose(here.covariance[k], np.diag(UNOBSERVED_DEVIATION**2))


def test_a_bias_of_the_view_leaves_parts_to_each_other_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every displacement in the world, T_seen T^-1, is the same; about the middle it is as large as the level."""
    monkeypatch.setattr(shared, "OWN", 0.0)
    size = []
    for seed in range(400):
        seen = see(ViewBiasNoise(NOISE_LEVEL), seed)
        E = seen.poses @ pose.inverse(CYCLE.nominal_poses)
        middle = pose.at(CYCLE.nominal_poses[:, :3, 3].mean(axis=0))
        assert_allclose(E, np.tile(E[0], (5, 1, 1)), atol=1e-12)
        size.append(pose.log(pose.inverse(middle) @ E[0] @ middle))
    rms = np.sqrt(np.mean(np.array(size) ** 2, axis=0))
    assert_allclose(rms, np.repeat([2e-3, np.radians(2.0)], 3), rtol=0.18)


def test_errors_drift_from_operation_to_operation() -> None:
    """In the axes of the camera errors j operations apart are correlated by rho to the j."""
    A = Camera().T_world_camera[:3, :3]
    world = []
    for seed in range(800):
        seen = see(CorrelatedNoise(NOISE_LEVEL), seed)
        xi = twists(seen)
        R = seen.poses[:, :3, :3]
        world.append(np.concatenate([np.einsum("nij,nj->ni", R, half) @ A for half in (xi[:, :3], xi[:, 3:])], axis=1))
    z = np.array(world) / np.repeat([2e-3, np.radians(2.0)], 3)
    for j in range(1, 5):
        correlation = np.mean(z[:, j:] * z[:, :-j], axis=(0, 1))
        assert_allclose(correlation, CORRELATION**j, atol=5 * np.sqrt(2 / 800))
    cross = np.mean(z[:, :, 0] * z[:, :, 1])
    assert abs(cross) < 5 / np.sqrt(800)


def test_only_turns_about_axes_of_fourfold_symmetry_are_less_certain() -> None:
    """Errors about the centre of volume: castles like isotropic ones, cube and stick worse about x alone."""
    centred = []
    for seed in range(800):
        xi = twists(see(SymmetricNoise(NOISE_LEVEL), seed))
        solids = [CYCLE.assembly.solids[o.main] for o in CYCLE.assembly.operations]
        to = np.array([pose.adjoint(pose.inverse(pose.at(solid.centroid))) for solid in solids])
        centred.append((to @ xi[..., None])[..., 0])
    rms = np.sqrt(np.mean(np.array(centred) ** 2, axis=0)) / np.repeat([2e-3, np.radians(2.0)], 3)
    expected = np.ones((5, 6))
    expected[2:, 3] = FACTOR
    assert_allclose(rms, expected, rtol=0.13)


def test_of_a_part_of_revolution_the_turn_about_its_axis_is_as_wrong_as_stated() -> None:
    """A part that looks the same after any turn; else its region covers more than it says."""
    scenario = load_scenario("nested_bushings")
    layout = draw_layout(scenario, np.random.default_rng(3), 0.0)
    n = len(layout.poses)
    shown = Demonstration(scenario.assembly, layout.start, layout.poses, layout.start, np.zeros((n, 6, 6)))
    lengths = []
    for seed in range(300):
        seen = SymmetricNoise(NOISE_LEVEL)(scenario.assembly, shown, np.random.default_rng(seed))
        xi = pose.log(pose.inverse(seen.poses) @ layout.poses)
        lengths.append(np.einsum("ki,kij,kj->k", xi, np.linalg.inv(seen.covariance), xi))
    assert_allclose(np.mean(lengths, axis=0), 6.0, rtol=0.15)
