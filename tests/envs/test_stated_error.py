"""The stated error of the held part relative to its hole is that of true starts."""

from __future__ import annotations

import numpy as np
import pytest

from apo_bench.envs.apo_insert import APOInsert
from apo_bench.envs.insert_spaces import MM_DEG


def errors(scenario: str, trials: range, **how: str) -> tuple[np.ndarray, np.ndarray]:
    """True errors of the part at some starts and their stated deviations, (n, 6) each, [mm, deg]."""
    env = APOInsert(scenario, **how)
    true, stated = [], []
    for trial in trials:
        seen, _ = env.reset(options={"trial": trial})
        off = env.off * MM_DEG
        off[2] += 1e3 * env.control.left
        true.append(off - seen["agent_pos"][:6])
        stated.append(seen["plan"][6:12])
    return np.array(true), np.array(stated)


@pytest.mark.parametrize("scenario", ["stick_in_tower", "peg_in_hole"])
def test_stated_deviations_are_those_of_true_starts(scenario: str) -> None:
    """20 starts: with 9, the mean of the squares left 0.4 to 2 by chance."""
    true, stated = errors(scenario, range(7000, 7020))
    assert 0.4 < np.square(true / stated).mean() < 2.0
    assert np.abs(true / stated).max() < 5.0


def test_a_shift_that_both_parts_share_cancels_and_a_tilt_does_not() -> None:
    stated = {
        error: errors("peg_in_hole", range(7000, 7001), corrector="oracle", robot_error=error)[1][0]
        for error in ("none", "hand_eye:1/0", "hand_eye:0/0.2")
    }
    assert stated["none"].max() < 0.2  # friction of the grasps alone
    assert stated["hand_eye:1/0"][2] < 0.2  # the height of the hand is the same at both ends
    assert stated["hand_eye:0/0.2"][2] > 0.5  # its tilt makes another height at each


def test_what_contacts_fix_is_known_and_what_they_leave_free_is_not() -> None:
    stated = errors("stick_in_tower", range(7000, 7001), robot_error="none")[1][0]
    assert stated[1] < 0.3  # across the hole, where walls face each other
    assert stated[2] > 0.8  # along it
