"""What a touch may be: each thing that is wrong with one gets one sentence."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest

from apo_bench import InputError
from apo_bench.correction.calibration import Touch

RIGHT: dict[str, Any] = {
    "T_world_tip": np.eye(4),
    "normal": (0, 0, 1),
    "offset": 0.1,
    "point": (0.0, 0.0, 0.0),
    "sigma_m": 1e-5,
    "jacobian": np.zeros((6, 7)),
    "grasp": 0,
    "T_tip_part": np.eye(4),
}
MIRROR = np.diag([1.0, 1.0, -1.0, 1.0])


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"T_world_tip": np.eye(3)}, r"T_world_tip of Touch: an array of shape \(4, 4\) is needed"),
        ({"T_world_tip": MIRROR}, "the pose of the tip was given as a matrix that is no rigid pose"),
        ({"normal": (0.0, 0.0, 2.0)}, "with a normal of length 2 was given; divide it by its length"),
    ],
)
def test_what_is_wrong_is_said(wrong: dict[str, Any], sentence: str) -> None:
    Touch(**RIGHT)
    with pytest.raises(InputError, match=sentence):
        Touch(**{**RIGHT, **wrong})


def test_a_touch_never_changes() -> None:
    at = np.eye(4)
    touch = Touch(**{**RIGHT, "T_world_tip": at})
    at[0, 3] = 1.0
    assert touch.T_world_tip[0, 3] == 0.0
    assert not copy.deepcopy(touch).T_world_tip.flags.writeable
