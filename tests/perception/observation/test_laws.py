"""Laws that every noise model with a name obeys, whoever adds it: what it states is true, and it reaches the robot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from apo_bench import Demonstration, Observation, observe
from apo_bench.geometry import Array, pose
from apo_bench.perception.observation.models import line_of_sight as sighted
from apo_bench.perception.observation.models.camera import Camera
from apo_bench.perception.observation.models.displacement import COVARIANCE_FLOOR
from apo_bench.perception.observation.models.isotropic import IsotropicNoise
from apo_bench.perception.observation.noise import FAILURES, NOISES, Noise, NoiseLevel, make_noise
from tests import scenes

NAMES = sorted(NOISES)
STEADY = sorted({*NOISES} - {*FAILURES})
"""Those whose errors all have what is stated; failures have laws of their own, in test_failures.py."""
NOISE_LEVEL = NoiseLevel(2.0, 2.0)
CYCLE = scenes.turned(scenes.subassembly_on_castles(), pose.at((0.1, -0.02, 0.0), (20.0, 35.0, 23.0)))
"""Five operations: castles with their origin off the centre, a cube that is moved twice, a stick."""
TRIALS = 700
BOUND = 5.0
"""Observations behind a law, and how many standard errors off a mean may be."""


class Draws(NamedTuple):
    """Errors of the operations that were seen, in units of what was stated; (trials, n, 6)."""

    unit: Array
    seen: Array
    """(trials, n)."""


def drawn(noise: Noise, trials: int = TRIALS) -> Draws:
    demonstration = scenes.shown(CYCLE)
    observations = [observe(demonstration, noise, np.random.default_rng(seed)) for seed in range(trials)]
    xi = pose.log(pose.inverse(CYCLE.nominal_poses) @ np.array([observation.poses for observation in observations]))
    L = np.linalg.cholesky(np.array([observation.covariance for observation in observations]))
    seen = np.array([observation.observed for observation in observations], dtype=np.float64)
    return Draws(np.linalg.solve(L, xi[..., None])[..., 0] * seen[..., None], seen)


def bias(draws: Draws) -> float:
    """How many standard errors the mean of the worst component of the worst operation is away from zero.

    Operations of one trial may be correlated, so each has its own mean over trials.
    """
    count = draws.seen.sum(axis=0)[:, None]
    mean = draws.unit.sum(axis=0) / count
    deviation = np.sqrt((draws.unit**2).sum(axis=0) / count)
    return float((np.abs(mean) / (deviation / np.sqrt(count))).max())


def mismatch(draws: Draws, inflation: float = 1.0) -> float:
    """How many standard errors the worst entry of any operation's second moments is away from those declared.

    The standard error is that of the products themselves, so heavy tails widen it.
    """
    worst = 0.0
    for k in range(draws.unit.shape[1]):
        z = draws.unit[draws.seen[:, k] > 0.0, k] / np.sqrt(inflation)
        products = z[:, :, None] * z[:, None, :]
        error = products.std(axis=0) / np.sqrt(len(z))
        worst = max(worst, float((np.abs(products.mean(axis=0) - np.eye(6)) / error).max()))
    return worst


@pytest.mark.parametrize("name", STEADY)
def test_errors_have_zero_mean_and_the_covariance_that_is_declared(name: str) -> None:
    """Over seeds; gross outliers, a tenth that err ten times as much, are not part of what is stated."""
    noise = make_noise(name, NOISE_LEVEL)
    draws = drawn(noise)
    assert bias(draws) < BOUND
    assert mismatch(draws, 10.9 if name == "outliers" else 1.0) < BOUND


@dataclass(frozen=True)
class Cheat:
    """A model that states what it does not do."""

    offset: float = 0.0
    factor: float = 1.0
    skew: float = 0.0

    def __call__(self, assembly: Any, shown: Demonstration, rng: np.random.Generator) -> Observation:
        seen = IsotropicNoise(NOISE_LEVEL)(assembly, shown, rng)
        sigma = np.sqrt(np.diagonal(seen.covariance, axis1=1, axis2=2))
        unit = pose.log(pose.inverse(shown.poses) @ seen.poses) / sigma
        unit = self.factor * unit + self.offset * np.eye(6)[4] + self.skew * np.roll(unit, 1, axis=1)
        return replace(seen, poses=shown.poses @ pose.exp(unit * sigma))


@cache
def honest() -> Draws:
    return drawn(Cheat())


@pytest.mark.parametrize(
    ("cheat", "check"),
    [
        (Cheat(offset=0.35), bias),
        (Cheat(factor=1.2), mismatch),
        (Cheat(factor=0.85), mismatch),
        (Cheat(skew=0.3), mismatch),
    ],
)
def test_the_law_would_notice(cheat: Noise, check: Callable[[Draws], float]) -> None:
    assert check(drawn(cheat)) > BOUND
    assert check(honest()) < BOUND


def in_another_world(scene: scenes.Scene, name: str, W: Array, monkeypatch: pytest.MonkeyPatch) -> Observation:
    """What is seen where the scene and the camera are turned together, with the same chance."""
    noise: Any = make_noise(name, NOISE_LEVEL)
    rng: Any = np.random.default_rng(3)
    if hasattr(noise, "camera"):
        noise = replace(noise, camera=Camera(W @ noise.camera.T_world_camera))
    if name == "anisotropic":  # its camera is a direction of the world, and so are its draws
        sight = W[:3, :3] @ sighted.get_line_of_sight()
        monkeypatch.setattr(sighted, "get_line_of_sight", lambda: sight)
        turn = np.kron(np.eye(2), W[:3, :3].T)

        class Turned(np.random.Generator):
            def standard_normal(self, size: Any) -> Array:  # type: ignore[override]
                return super().standard_normal(size) @ turn

        rng = Turned(np.random.PCG64(3))
    return observe(scenes.shown(scenes.turned(scene, W)), noise, rng)


@pytest.mark.parametrize("name", NAMES)
def test_the_choice_of_the_world_frame_does_not_count(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scene and camera turned by W: the goals turn with them, and what is stated in the frames of parts stays."""
    here = observe(scenes.shown(CYCLE), make_noise(name, NOISE_LEVEL), np.random.default_rng(3))
    for W in (pose.at((0.4, -0.3, 0.2), (30.0, -50.0, 80.0)), pose.at((-2.0, 1.0, 0.5), (170.0, 5.0, -95.0))):
        with monkeypatch.context() as patch:
            there = in_another_world(CYCLE, name, W, patch)
        assert_allclose(there.poses, W @ here.poses, atol=1e-12)
        assert_allclose(there.covariance, here.covariance, rtol=1e-9, atol=1e-15)
        assert_array_equal(there.observed, here.observed)


@pytest.mark.parametrize("name", STEADY)
def test_levels_scale_the_same_errors_and_use_chance_alike(name: str) -> None:
    """Twists scale with the level, up to the turn by which the frame that is seen differs; so do deviations."""
    seen = []
    after = set()
    for factor in (1.0, 4.0):
        rng = np.random.default_rng(2)
        seen.append(observe(scenes.shown(CYCLE), make_noise(name, NoiseLevel(0.5 * factor, 0.75 * factor)), rng))
        after.add(rng.random())
    weak, strong = (pose.log(pose.inverse(CYCLE.nominal_poses) @ observation.poses) for observation in seen)
    assert_array_equal(seen[0].observed, seen[1].observed)
    there = seen[0].observed
    assert there.any()
    assert_allclose(strong[there, 3:], 4.0 * weak[there, 3:], rtol=1e-6, atol=1e-9)
    lengths = [np.linalg.norm(xi[there, :3], axis=1) for xi in (weak, strong)]
    assert_allclose(lengths[1], 4.0 * lengths[0], rtol=1e-6)
    weight = [np.trace(observation.covariance[there][:, :3, :3], axis1=1, axis2=2) for observation in seen]
    assert_allclose(weight[1], 16.0 * weight[0], rtol=1e-2)
    assert len(after) == 1


@pytest.mark.parametrize("name", NAMES)
def test_level_zero_shows_what_was_shown_bit_for_bit(name: str) -> None:
    for seed in range(40):
        seen = observe(scenes.shown(CYCLE), make_noise(name, NoiseLevel(0.0, 0.0)), np.random.default_rng(seed))
        assert seen.poses.tobytes() == CYCLE.nominal_poses.tobytes()
        assert seen.observed.all()
        assert_allclose(seen.covariance, np.tile(np.diag(COVARIANCE_FLOOR**2), (5, 1, 1)), rtol=1e-9, atol=1e-20)


@pytest.mark.parametrize("name", NAMES)
def test_one_seed_gives_the_same_bytes_and_another_one_others(name: str) -> None:
    def made(seed: int) -> bytes:
        seen = observe(scenes.shown(CYCLE), make_noise(name, NOISE_LEVEL), np.random.default_rng(seed))
        return seen.poses.tobytes() + seen.covariance.tobytes() + seen.observed.tobytes()

    assert made(1) == made(1)
    assert made(1) != made(2)
