"""How far a part has moved in the hand."""

import numpy as np
import pytest

from apo_bench.geometry import pose
from apo_bench.simulation.robot.in_hand import HoldWatch

GRASPED = pose.at((0.01, 0.02, 0.03), (0.0, 90.0, 20.0))
"""A part in the frame of the tip."""


def test_a_shaft_that_rolls_between_the_pads_turns_about_the_point_between_them_and_slides_nowhere():
    rolled = pose.at((0.0, 0.0, 0.0), (30.0, 0.0, 0.0)) @ GRASPED
    (one,) = HoldWatch().grasp(GRASPED).carry(GRASPED).release(rolled).finish(2).finished
    assert (one.operation, one.carried_m, one.carried_rad) == (2, 0.0, pytest.approx(0.0, abs=1e-7))
    assert one.moved_m == pytest.approx(0.0, abs=1e-12)
    assert one.moved_rad == pytest.approx(np.radians(30.0))


def test_the_larger_one_counts_of_two_grips_and_what_was_never_held_is_left_out():
    slid = pose.at((0.0, 0.0, 0.004)) @ GRASPED
    watch = HoldWatch().finish(0).grasp(GRASPED).carry(slid).release(slid).grasp(slid).release(slid).finish(1)
    (one,) = watch.finished
    assert (one.operation, one.carried_m, one.moved_m) == (1, pytest.approx(0.004), pytest.approx(0.004))
    assert watch.grasped is None
