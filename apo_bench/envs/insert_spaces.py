"""Observation and action spaces of `APOInsert-v0`, and the observations themselves.

The guide on insertion explains every number.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from apo_bench.geometry import Array
from apo_bench.simulation.task.tip_control import PERIOD_S, TipControl

Action = NDArray[np.float32]
MM_DEG = np.repeat([1e3, 180.0 / math.pi], 3)
"""Converts a twist from [m, rad] to [mm, deg]."""
PIXELS = 96
"""Width and height of images."""
CAMERAS = ("scene", "wrist")
"""Cameras whose images can be part of an observation."""
_FAR_MM_DEG = np.repeat([500.0, 180.0], 3)  # bounds of a tip error
_FORCES = np.repeat([1000.0, 1000.0], 3)  # bounds of a wrench, [N, Nm]
_BOUNDS = {
    "agent_pos": np.array([*_FAR_MM_DEG, *_FAR_MM_DEG, 100.0]),
    "wrench": _FORCES,
    "plan": np.array([1.0, 1.0, 1.0, 500.0, 500.0, 1e4, *_FAR_MM_DEG, 1e4, *_FAR_MM_DEG]),
}
"""Name -> bound of each number of the group `policy`."""
_CRITIC = np.array([*_FAR_MM_DEG, *_FORCES[:3], 1.0])
"""Bound of each number of the group `critic`."""


def insert_space(pixels: Sequence[str], critic: bool) -> spaces.Dict:
    """Return the observation space, with images of these cameras, and with or without the group `critic`."""
    bounds = {**_BOUNDS, "critic": _CRITIC} if critic else _BOUNDS
    boxes: dict[str, spaces.Space[Any]] = {name: _make_box(most) for name, most in bounds.items()}
    for camera in pixels:
        boxes[pixels_key(camera)] = spaces.Box(0, 255, (PIXELS, PIXELS, 3), np.uint8)
    return spaces.Dict(boxes)


def pixels_key(camera: str) -> str:
    """Return the key of the image of a camera in an observation."""
    return f"pixels_{camera}"


def policy_entries(
    control: TipControl,
    wrench: Array,
    deviations: Array,
    best: float,
    left: int,
    penalised_n: float,
    target: Array,
) -> dict[str, Any]:
    """Return the present observation of the group `policy` without images.

    Args:
        wrench: As the sensor has it, (6,), insertion frame, [N, Nm].
        deviations: Stated standard deviations of front and rotation, (6,), [m, rad].
        best: Smallest distance left along the insertion axis so far, [m].
        left: Number of actions left.
        penalised_n: Force above which the reward has a penalty, [N].
        target: The displacement of the tip by the actions so far, (6,), [m, rad].
    """
    feel = control.reading
    # distance left [mm], smallest so far [mm], time left [s]
    way = (-1e3 * float(feel.tip[2]), 1e3 * best, PERIOD_S * left)
    entries: dict[str, Any] = {
        "agent_pos": [*feel.tip * MM_DEG, *feel.lag * MM_DEG, 1e3 * feel.opening],
        "wrench": wrench,
        "plan": [*control.start.direction, *way, *deviations * MM_DEG, penalised_n, *target * MM_DEG],
    }
    return {name: _clip(entries[name], most) for name, most in _BOUNDS.items()}


def critic_entry(control: TipControl, off: Array) -> Action:
    """Return the observation of the group `critic`, (10,).

    Args:
        off: The true error of the part relative to its target, (6,), [m, rad].
    """
    return _clip([*off * MM_DEG, *control.contact_force, control.touches], _CRITIC)


def _clip(numbers: Any, most: Array) -> Action:
    """Return numbers as float32 within their bounds."""
    return np.clip(numbers, -most, most).astype(np.float32)


def _make_box(most: Array) -> spaces.Box:
    """Return the space of numbers within these bounds, of either sign."""
    bound = most.astype(np.float32)
    return spaces.Box(-bound, bound, dtype=np.float32)
