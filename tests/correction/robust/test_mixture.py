"""The covariance of hypotheses that lead to nearly the same goals, and the region of all."""

from dataclasses import replace

import numpy as np
import pytest

from apo_bench.assembly import Hypothesis, Observation
from apo_bench.correction.correctors import correct
from apo_bench.correction.region import contains_truth
from apo_bench.correction.robust.mixture import mode_covariance
from apo_bench.geometry import pose
from tests.correction.robust.test_robust import look

SIGMA = np.array([1e-3, 2e-3, 3e-3, 0.01, 0.02, 0.03])


def of(observation: Observation, weight: float, off=None, deviation=SIGMA) -> Hypothesis:
    """A hypothesis whose goals are those that were seen, moved by a body twist."""
    n = len(observation.poses)
    goals = observation.poses @ pose.exp(np.zeros(6) if off is None else np.asarray(off, dtype=np.float64))
    return Hypothesis(weight, goals, np.tile(np.diag(deviation**2), (n, 1, 1)), observation)


@pytest.fixture(name="observation")
def _observation() -> Observation:
    return look("stick_in_tower", 0)


def test_of_a_mode_it_is_the_second_moment_about_the_goals_of_the_first(observation):
    off = np.array([2e-3, 0.0, 0.0, 0.0, 0.0, 0.0])
    found = mode_covariance((of(observation, 0.75), of(observation, 0.25, off, 2.0 * SIGMA)))
    expected = (0.75 + 0.25 * 4.0) * np.diag(SIGMA**2) + 0.25 * np.outer(off, off)
    # A turn at the other place moves this one, too, but that is small.
    np.testing.assert_allclose(found[:, :3, :3], np.tile(expected[:3, :3], (len(observation.poses), 1, 1)), atol=2e-9)


def test_the_region_of_a_correction_is_that_of_enough_hypotheses(observation):
    found = correct(observation, "contact")
    truth = found.poses
    away = replace(observation, poses=observation.poses @ pose.exp(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 3.0])))
    right = Hypothesis(0.1, truth, found.covariance, observation)
    wrong = Hypothesis(0.9, away.poses, found.covariance, away)
    assert contains_truth(observation, replace(found, hypotheses=(wrong, right)), truth)
    sure = (replace(wrong, weight=0.99), replace(right, weight=0.01))
    assert not contains_truth(observation, replace(found, hypotheses=sure), truth)
