"""Failures that a later look repeats are counted where looks are at one scene, and nowhere else."""

import numpy as np
import pytest

from apo_bench import Observation, load_scenario
from apo_bench.geometry import pose
from apo_bench.trial.learned_noise import JudgedLook, Repeats, repeats

SCENARIO = load_scenario("stick_in_tower")
NEAR = np.array([8.0, 8.0])
FALSE = pose.at((0.0, 0.0, 0.0), (0.0, 0.0, 180.0))


def look(*false: int, off_mm: float = 0.0, where_mm: float = 0.0, unseen: tuple[int, ...] = ()) -> JudgedLook:
    """One look, at the scenario's own goals but for operations that are turned round."""
    goals = pose.at((1e-3 * where_mm, 0.0, 0.0)) @ SCENARIO.goals
    seen = goals.copy()
    for k in false:
        seen[k] = goals[k] @ FALSE @ pose.at((1e-3 * off_mm, 0.0, 0.0))
    n = len(goals)
    observation = Observation(
        SCENARIO.assembly,
        SCENARIO.start,
        seen,
        np.tile(1e-6 * np.eye(6), (n, 1, 1)),
        np.array([k not in unseen for k in range(n)]),
    )
    return JudgedLook(observation, goals, frozenset(false))


@pytest.mark.parametrize(
    ("looks", "counted"),
    [
        ([look(1), look(1)], (1, 1)),
        ([look(1), look(1, off_mm=2.0), look()], (1, 2)),
        ([look(1), look(1, off_mm=40.0)], (0, 1)),
        ([look(1), look(2)], (0, 1)),
        ([look(), look(1)], (0, 0)),
        ([look(1), look(unseen=(1,))], (0, 0)),
        ([look(1), look(1, where_mm=50.0)], (0, 0)),
        ([look(1)], (0, 0)),
    ],
)
def test_repeats_are_counted_from_one_look_to_the_next(looks: list[JudgedLook], counted: tuple[int, int]) -> None:
    assert repeats(looks, NEAR) == counted


def test_the_rate_lies_in_its_interval_and_is_never_certain() -> None:
    assert Repeats(0, 0).rate is None
    for repeated in (0, 5, 10):
        rate = Repeats(repeated, 10).rate
        assert rate is not None
        assert 0.0 < rate.low < rate.value < rate.high < 1.0
