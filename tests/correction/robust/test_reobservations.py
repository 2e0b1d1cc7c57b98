"""Looking again: what is asked for, and what comes of several views of one operation."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from apo_bench import correct
from apo_bench.geometry import pose
from tests.correction.robust.test_robust import astray, fixed_error_mm, look, shown


class Again:
    """Looks that were taken beforehand; it keeps what was asked for."""

    def __init__(self, *observations):
        self.observations = list(observations)
        self.asked = []

    @property
    def left(self):
        return len(self.observations)

    def __call__(self, operations):
        self.asked.append(tuple(operations))
        made = self.observations.pop(0)
        return replace(made, observed=made.observed & np.isin(np.arange(len(made.observed)), operations))


def fresh(name, seed, number):
    return look(name, seed + 100 * (number + 1))


def at_the_same_place(name, seed, number):
    """Another look at the demonstration of `look(name, seed)`."""
    first = shown(name, seed)[2]
    other = shown(name, seed + 100 * (number + 1))[2]
    twists = pose.log(pose.inverse(other.poses) @ fresh(name, seed, number).poses)
    return replace(look(name, seed), poses=first.poses @ pose.exp(twists))


def test_where_nothing_is_in_doubt_nobody_asks():
    again = Again(at_the_same_place("vanished_fixture", 1, 0))
    observation = look("vanished_fixture", 1)
    assert (
        correct(observation, "contact-robust", again).poses.tolist() == correct(observation, "contact").poses.tolist()
    )
    assert again.asked == []


def test_what_was_left_out_is_looked_at_again_until_it_is_right():
    """The second view of operation 2 is as wrong as the first."""
    name = "carried_bridge"
    k = 1
    second = astray(at_the_same_place(name, 2, 0), k, seed=9)
    again = Again(second, at_the_same_place(name, 2, 1), at_the_same_place(name, 2, 2))
    found = correct(astray(look(name, 2), k), "contact-robust", again)
    assert found.ok
    assert all(k in asked for asked in again.asked)
    assert len(again.asked) == 2
    assert found.left_out == ()
    assert "looked again at operation" in found.sentence
    assert_allclose(found.poses[k][:3, 3], shown(name, 2)[2].poses[k][:3, 3], atol=5e-3)
    assert fixed_error_mm(name, 2, found) < 0.35


def test_an_operation_of_which_nothing_is_told_is_asked_for():
    observation = look("block_on_block", 0)
    operations = [replace(one, contacts=()) for one in observation.assembly.operations]
    lonely = replace(observation, assembly=replace(observation.assembly, operations=tuple(operations)))
    missed = replace(lonely, observed=np.array([False, True]))
    again = Again(replace(at_the_same_place("block_on_block", 0, 0), assembly=lonely.assembly))
    assert correct(missed, "contact-robust", again).ok
    assert again.asked == [(0,)]
    assert correct(missed, "contact-robust", Again()).status == "not_seen"


def exchanged(observation, k, i):
    """The observation with the poses of two operations in each other's place."""
    poses = np.array(observation.poses)
    poses[[k, i]] = poses[[i, k]]
    return replace(observation, poses=poses)


@pytest.mark.parametrize("last", [(), (1,)])
def test_parts_that_are_seen_in_each_others_place_twice_are_told_apart(last):
    """Operations 2 and 3 are swapped in two observations that agree; in the second case a third one is right."""
    name = "fixture_alignment"
    again = Again(
        exchanged(at_the_same_place(name, 1, 0), 1, 2), *(at_the_same_place(name, 1, number) for number in last)
    )
    found = correct(exchanged(look(name, 1), 1, 2), "contact-robust", again)
    assert found.ok
    assert_allclose(found.poses[:, :3, 3], shown(name, 1)[2].poses[:, :3, 3], atol=8e-3)


def test_an_operation_that_was_seen_where_a_doubted_one_was_goes_with_it():
    """Operation 2 is seen in the place of operation 3, then in that of operation 1."""
    name = "fixture_alignment"
    second, third = (exchanged(at_the_same_place(name, 1, number), 0, 1) for number in (0, 1))
    again = Again(second, third)
    found = correct(exchanged(look(name, 1), 1, 2), "contact-robust", again)
    assert again.asked == [(1, 2), (0, 1, 2)]
    assert_allclose(found.poses[:, :3, 3], shown(name, 1)[2].poses[:, :3, 3], atol=8e-3)
