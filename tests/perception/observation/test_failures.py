"""How cameras fail: each kind does what it says, as often as it says, and looks repeat as often as they should."""

from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from apo_bench import Demonstration, draw_layout, load_scenario
from apo_bench.geometry import find_approximate_symmetries, pose
from apo_bench.perception.observation.models.camera_failures import PRESETS, make_failures
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.perception.observation.observe import observe
from apo_bench.perception.observation.reobservations import Reobservations

NOISE_LEVEL = NoiseLevel(1.0, 1.0)


@cache
def demonstration():
    scenario = load_scenario("vanished_fixture")
    layout = draw_layout(scenario, np.random.default_rng(0), 0.0)
    return Demonstration(scenario.assembly, layout.start, layout.poses, layout.start, np.zeros((5, 6, 6)))


def failures(kind, seed, **settings):
    shown = demonstration()
    return make_failures(kind, NOISE_LEVEL, **settings).draw_false(shown, np.random.default_rng(seed))


@pytest.mark.parametrize(("kind", "low", "high"), [("flips", 0.25, 0.35), ("stale", 0.25, 0.35), ("rays", 0.25, 0.35)])
def test_failures_are_as_often_as_stated(kind, low, high):
    """0.3 of 1500 draws: 0.05 is four standard deviations."""
    assert low < np.mean([failures(kind, seed).false for seed in range(300)]) < high
    assert not any(failures(kind, seed, rate=0.0).false.any() for seed in range(20))


def test_a_flip_is_by_an_approximate_symmetry():
    shown = demonstration()
    flipped = failures("flips", 1, rate=1.0)
    assert flipped.false.all()
    for operation, T, seen in zip(shown.assembly.operations, shown.poses, flipped.poses, strict=True):
        turns = find_approximate_symmetries(shown.assembly.solids[operation.main]).turns
        assert (np.abs(turns - pose.inverse(T) @ seen).max(axis=(1, 2)) < 1e-9).any()


def test_a_stale_pose_is_where_the_part_was_before():
    shown = demonstration()
    stale = failures("stale", 1, rate=1.0)
    mains = [operation.main for operation in shown.assembly.operations]
    assert mains[1] == mains[3]
    assert_array_equal(stale.poses[3], shown.poses[1])
    assert_array_equal(stale.poses[1], shown.start[mains[1]])


def test_swaps_exchange_two_views_of_like_parts():
    shown = demonstration()
    swapped = next(f for f in (failures("swaps", seed) for seed in range(99)) if f.false[0])
    assert shown.assembly.operations[2].main == "castle2"
    assert_array_equal(swapped.poses[0], shown.poses[2])
    assert_array_equal(swapped.poses[2], shown.poses[0])


@pytest.mark.parametrize("repeat", [0.0, 0.8])
def test_a_later_look_repeats_what_was_false_as_often_as_stated(repeat):
    """Of some 450 failures; 0.1 is more than four standard deviations of either share."""
    shown = demonstration()
    repeated = []
    for seed in range(300):
        model = make_failures("rays", NOISE_LEVEL, repeat=repeat)
        first = model.draw_false(shown, np.random.default_rng(seed))
        look = Reobservations(shown, model, np.random.default_rng([seed, 1]), 1, first=np.random.default_rng(seed))
        seen = look(range(5))
        near = np.linalg.norm(seen.poses[:, :3, 3] - first.poses[:, :3, 3], axis=1) < 6e-3
        repeated += near[first.false].tolist()
    assert abs(np.mean(repeated) - repeat) < 0.1


def test_rates_may_follow_the_name():
    noise = make_noise("flips:p=0.1/r=0.5", NOISE_LEVEL)
    assert (noise.failures, noise.repeat) == ((PRESETS["flips"]._replace(rate=0.1),), 0.5)
    assert make_noise("stale:r=0.5", NOISE_LEVEL).failures == make_noise("stale", NOISE_LEVEL).failures
    stated = observe(demonstration(), "flips:p=0.1/r=0.5", np.random.default_rng(1)).outliers
    assert (stated.gross, stated.repeat) == pytest.approx((0.1, 0.5))
