"""Baseline correctors: what each promises, which is less than the contacts ask for."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from apo_bench import Observation, correct
from apo_bench.correction.baselines.intruding_boxes import intruding
from apo_bench.correction.baselines.least_squares import least_squares
from apo_bench.correction.baselines.penalty import loss
from apo_bench.geometry import Array, pose
from apo_bench.simulation.scene.settling import settle
from tests import scenes

STATIC = ("snap", "least-squares", "penalty")
SIGMA = np.repeat([1e-3, np.radians(1.0)], 3)


def noisy(name: str, seed: int = 0) -> Observation:
    built = scenes.ALL[name]()
    return scenes.seen(built, scenes.noisy(built.nominal_poses, np.random.default_rng(seed), 1.0, 1.0))


def length(seen: Observation, goals: Array) -> float:
    """|z| of goals, in standard deviations."""
    return float(np.linalg.norm(pose.log(pose.inverse(seen.poses) @ goals) / SIGMA))


@pytest.mark.numeric
@pytest.mark.parametrize("name", ["fixture", "pockets"])
@pytest.mark.parametrize(("method", "within"), [("snap", 1e-12), ("least-squares", 1e-12), ("penalty", 1e-3)])
def test_what_is_consistent_stays_as_it_is(method: str, within: float, name: str) -> None:
    """But for `penalty`: Adam follows gradients that are rounding, and ended up to 4.5e-4 away under other kernels."""
    built = scenes.ALL[name]()
    made = correct(scenes.seen(built, built.nominal_poses), method)
    assert made.ok
    assert made.gap_after_m < 1e-6
    assert np.abs(made.poses - built.nominal_poses).max() < within


@pytest.mark.parametrize("method", [*STATIC, settle])
def test_an_operation_that_was_not_seen_is_refused(method: Any) -> None:
    seen = noisy("bridge")
    made = correct(replace(seen, observed=np.array([True, False, True])), method)
    assert (made.status, made.sentence) == ("not_seen", "operation 2 was not seen")
    assert np.array_equal(made.poses, seen.poses)


def test_snap_takes_the_most_likely_of_all_poses_that_fit() -> None:
    """One goal, correlated noise: the limit of ever harder contacts."""
    seen = noisy("bridge")
    A = np.random.default_rng(1).standard_normal((6, 6)) * SIGMA[:, None]
    first = Observation(seen.assembly.first(1), seen.start, seen.poses[:1], (A @ A.T)[None], seen.observed[:1])
    hard = least_squares(first, contact_m=1e-7)
    assert np.allclose(correct(first, "snap").poses, hard.poses, atol=1e-7)


@pytest.mark.parametrize("contact_m", [1e-5])
@pytest.mark.parametrize("name", ["stick_in_tower", "pockets"])
def test_least_squares_is_no_worse_than_the_truth(name: str, contact_m: float) -> None:
    """The truth has no gap, so at the optimum (e / contact_m)^2 + |z|^2 is at most the squared length of the noise."""
    seen = noisy(name)
    truth = scenes.ALL[name]().nominal_poses
    made = correct(seen, partial(least_squares, contact_m=contact_m))
    assert made.gap_after_m**2 / contact_m**2 + length(seen, made.poses) ** 2 <= length(seen, truth) ** 2 * (1 + 1e-9)
    assert made.gap_after_m < 0.5 * contact_m


@pytest.mark.parametrize("name", ["fixture", "pockets"])
def test_the_gradient_of_the_penalty_is_that_of_differences(name: str) -> None:
    seen = noisy(name)
    down = loss(seen)
    z = np.random.default_rng(2).standard_normal(6 * len(seen.poses)) * 0.3
    h = 1e-6
    _, gradient = down(z)
    differences = [(down(z + h * e)[0] - down(z - h * e)[0]) / (2 * h) for e in np.eye(len(z))]
    assert len(intruding(down.meetings, down.space.poses(z))) > 0
    assert np.allclose(gradient, differences, rtol=1e-5, atol=1e-6 * np.abs(gradient).max())


@pytest.mark.parametrize("name", ["bridge", "fixture"])
def test_the_descent_goes_down_and_closes_most_of_the_gap(name: str) -> None:
    seen = noisy(name)
    made = correct(seen, "penalty")
    down = loss(seen)
    z = (pose.log(pose.inverse(seen.poses) @ made.poses) / SIGMA).ravel()
    assert down(z)[0] < 0.05 * down(np.zeros_like(z))[0]
    assert made.gap_after_m < 0.05 * made.gap_before_m
