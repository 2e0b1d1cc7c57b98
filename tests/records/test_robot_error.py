"""Names of what is wrong with the robot: spelled in one way, and one sentence where there is no such error."""

from __future__ import annotations

import pytest

from apo_bench import InputError
from apo_bench.records import (
    normalise_assumed_robot_error,
    normalise_robot_error,
    parse_assumed_error,
    parse_robot_error,
)
from apo_bench.records.robot_error import Sigmas


@pytest.mark.parametrize(
    ("given", "spelled"),
    [
        ("none", "none"),
        ("hand_eye:0", "none"),
        ("tool:0.50+hand_eye:1.0/0", "hand_eye:1+tool:0.5"),
        ("in_hand:0/2+joints:.05", "joints:0.05+in_hand:0/2"),
        ("ft_drift:2+finger:1+base_tilt:.1+sag:0.7", "sag:0.7+base_tilt:0.1+finger:1+ft_drift:2"),
    ],
)
def test_a_name_is_spelled_in_one_way_that_reads_back(given: str, spelled: str) -> None:
    assert normalise_robot_error(given) == spelled == normalise_robot_error(spelled)
    assert parse_robot_error(given) == parse_robot_error(spelled)


def test_what_is_not_stated_is_zero() -> None:
    assert Sigmas() == parse_robot_error("none")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            "elbow:1",
            "unknown kind of robot error 'elbow'. Known: base_tilt, finger, ft_drift, hand_eye, in_hand, joints, none,",
        ),
        (
            "tool:1/2",
            "the robot error 'tool:1/2' was given; standard deviations in mm from 0 to 20 are allowed: tool:0.5.",
        ),
    ],
)
def test_what_is_no_robot_error_is_one_sentence(given: str, said: str) -> None:
    with pytest.raises(InputError) as refused:
        normalise_robot_error(given)
    assert str(refused.value).startswith(said)


@pytest.mark.parametrize(
    ("given", "spelled", "told"),
    [
        ("matched", "matched", "tool:0.2"),
        ("unknown", "unknown", None),
        ("tool:0.50+hand_eye:1.0/0", "hand_eye:1+tool:0.5", "hand_eye:1+tool:0.5"),
    ],
)
def test_what_a_robot_is_told_is_what_is_drawn_nothing_or_something_else(
    given: str, spelled: str, told: str | None
) -> None:
    assert normalise_assumed_robot_error(given) == spelled == normalise_assumed_robot_error(spelled)
    assert parse_assumed_error(spelled, "tool:0.2") == told
