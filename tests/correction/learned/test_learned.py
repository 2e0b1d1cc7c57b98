"""A network that was trained says whose pose is wrong: what it is told, what it says, and what contacts make of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from apo_bench import Demonstration, Observation, draw_layout, load_scenario
from apo_bench.assembly import lowered_observation
from apo_bench.correction.correctors import correct
from apo_bench.correction.learned.network import as_believed, forward, shapes, tokens
from apo_bench.geometry import pose
from apo_bench.observation.looking import observe
from apo_bench.observation.noise import Level, make_noise
from apo_bench.resources import folder
from apo_bench.trial.outcome_columns import goal_errors


def seen(name: str, seed: int, level: float = 1.0, noise: str = "isotropic") -> tuple[np.ndarray, Observation]:
    rng = np.random.default_rng([seed, 77])
    scenario = load_scenario(name)
    layout = draw_layout(scenario, rng, 0.0)
    shown = Demonstration(
        scenario.assembly, layout.start, layout.goals, layout.start, np.zeros((len(layout.goals), 6, 6))
    )
    return layout.goals, observe(shown, make_noise(noise, Level(level, level)), rng)


def displaced(observation: Observation, k: int, metres: float) -> Observation:
    goals = observation.goals.copy()
    goals[k, :3, 3] += metres
    return replace(observation, goals=goals)


def test_where_the_world_has_its_origin_does_not_matter() -> None:
    _, observation = seen("stick_in_tower", 0)
    T = pose.exp(np.array([0.3, -0.2, 0.1, 0.4, -0.3, 0.8]))
    moved = replace(
        observation, goals=T @ observation.goals, start={part: T @ at for part, at in observation.start.items()}
    )
    for a, b in zip(tokens(observation), tokens(moved), strict=True):
        assert a == pytest.approx(b, abs=1e-6)


def test_what_a_contact_says_is_in_units_of_the_stated_noise() -> None:
    """Twice as wrong and twice as uncertain: only the logarithms of the sizes change."""
    truth, observation = seen("stick_in_tower", 0, 0.01)
    xi = pose.log(pose.inverse(truth) @ observation.goals)
    doubled = replace(observation, goals=truth @ pose.exp(2 * xi), covariance=4 * observation.covariance)
    once, twice = tokens(observation), tokens(doubled)
    assert twice.edges == pytest.approx(once.edges, abs=0.2)
    assert twice.operations[:, 1:3] == pytest.approx(once.operations[:, 1:3] + np.log(2.0))


def test_the_share_of_what_is_not_seen_is_nothing() -> None:
    _, observation = seen("stick_in_tower", 0)
    found = tokens(replace(observation, seen=np.array([True, False, True])))
    assert (found.operations[:, 0] == (1, 0, 1)).all()
    assert (found.edges[:, 1] == 0.0).all()
    assert (found.gains[:, 1] == 0.0).all()
    assert not found.contacts[found.contacts[:, 0] == 0.0, 1].any()


def test_numbers_of_one_observation_do_not_depend_on_others_of_a_batch() -> None:
    weights = {name: np.random.default_rng(1).normal(size=shape) / 5 for name, shape in shapes().items()}
    given = [tokens(seen("stick_in_tower", seed)[1]) for seed in range(3)]
    together = forward(weights, type(given[0])(*map(np.array, zip(*given, strict=True))))
    for i, one in enumerate(given):
        for a, b in zip(forward(weights, one), together, strict=True):
            assert a == pytest.approx(b[i], abs=1e-9)


def test_weights_are_small() -> None:
    assert (folder("assets") / "learned" / "set.npz").stat().st_size < 4e6


@pytest.mark.parametrize("name", ["stick_in_tower", "vanished_fixture", "peg_in_hole"])
def test_what_is_exact_stays_so(name: str) -> None:
    truth, observation = seen(name, 0, 0.0)
    found = correct(observation, "learned-set")
    assert found.ok
    assert found.goals == pytest.approx(truth, abs=1e-4)


@pytest.mark.parametrize("k", range(3))
def test_a_pose_that_is_far_off_is_told_by_contacts(k: int) -> None:
    """By 50 standard deviations: it alone is believed much less than stated, or not at all, and the others stay."""
    for seed in range(3):
        truth, observation = seen("stick_in_tower", seed)
        wrong = displaced(observation, k, 0.03)
        believed, gross = as_believed(lowered_observation(wrong))
        wider = np.linalg.det(believed.covariance / observation.covariance.max())
        sure = np.linalg.det(observation.covariance / observation.covariance.max())
        scale = np.where(gross, np.inf, (wider / sure) ** (1 / 12))
        assert scale.argmax() == k
        assert scale[k] > 3.0
        assert np.delete(scale, k).max() < 2.0
        found = correct(wrong, "learned-set")
        assert found.ok
        assert goal_errors(observation.assembly, observation.start, truth, found.goals)[0] < 0.25


def test_what_was_not_seen_is_inferred() -> None:
    truth, observation = seen("stick_in_tower", 1)
    found = correct(replace(observation, seen=np.array([True, True, False])), "learned-set")
    assert found.ok
    assert np.abs(found.goals[2, :3, 3] - truth[2, :3, 3]).max() < 0.01


@pytest.mark.parametrize("noise", ["bias-view", "correlated", "bias"])
def test_errors_that_operations_share_stay_within_what_is_stated_of_each(noise: str) -> None:
    for seed in range(12):
        for name in ("stick_in_tower", "l_bracket_on_plate"):
            _, observation = seen(name, seed, 2.0, noise)
            assert correct(observation, "learned-set").ok
