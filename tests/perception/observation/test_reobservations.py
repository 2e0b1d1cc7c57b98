"""A look is a fresh draw of the same noise, and nothing but an observation."""

from functools import cache

import numpy as np
import pytest

from apo_bench import Demonstration, InputError, draw_layout, load_scenario
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.perception.observation.reobservations import Reobservations

N = 5


@cache
def demonstration():
    scenario = load_scenario("carried_bridge")
    layout = draw_layout(scenario, np.random.default_rng(0), 0.0)
    return Demonstration(scenario.assembly, layout.start, layout.poses, layout.start, np.zeros((N, 6, 6)), play_m=2e-4)


def looks(allowed, noise="isotropic", assembly=None):
    model = make_noise(noise, NoiseLevel(1.0, 1.0))
    return Reobservations(demonstration(), model, np.random.default_rng(7), allowed, assembly)


def test_what_was_not_asked_for_is_not_seen():
    look = looks(2)
    seen = look((3, 0, 3))
    assert seen.observed.tolist() == [True, False, False, True, False]
    assert (look.left, look.reobservations) == (1, 2)
    assert (seen.play_m, seen.assembly) == (2e-4, demonstration().assembly)
    assert look([4]).observed.tolist() == [False, False, False, False, True]
    assert (look.left, look.reobservations) == (0, 3)


def test_a_look_does_not_depend_on_what_was_asked_before():
    one = looks(2)
    other = looks(2)
    one([0])
    other([1, 2, 3])
    second = one([4])
    np.testing.assert_array_equal(second.poses[4], other([0, 4]).poses[4])
    assert not np.array_equal(second.poses[4], looks(1)([4]).poses[4])


@pytest.mark.parametrize("asked", [[], [N], ["a"]])
def test_a_look_at_what_is_not_there_is_refused_and_costs_nothing(asked):
    look = looks(1)
    with pytest.raises(InputError, match=rf"operations .* give one or more whole numbers from 0 to {N - 1}"):
        look(asked)
    assert look.left == 1


def test_no_more_looks_than_allowed():
    with pytest.raises(InputError, match="no reobservation is left"):
        looks(0)([0])
    with pytest.raises(InputError, match="max reobservations must be a whole number from 0 to 100, got -1"):
        looks(-1)
