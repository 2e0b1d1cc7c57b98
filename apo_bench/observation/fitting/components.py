"""What the noise of a camera consists of: errors in the frames of its rays, and errors that all operations share."""

from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.observation.models import LEVEL_UNITS, Camera


class NoiseComponent(NamedTuple):
    """A part of the noise with one unknown deviation."""

    name: str
    unit: str
    """mm or deg."""


COMPONENTS = (
    NoiseComponent("across the ray", "mm"),
    NoiseComponent("along the ray", "mm"),
    NoiseComponent("tilt, across the ray", "deg"),
    NoiseComponent("turn about the ray", "deg"),
    NoiseComponent("shift of the whole view", "mm"),
    NoiseComponent("turn of the whole view", "deg"),
)


def component_factors(camera: Camera, goals: Array, P: Array) -> tuple[Array, ...]:
    """F of each of `COMPONENTS`, (6 n, r): the body twists of goals (n, 4, 4), in mm and deg, are F e if it is 1.

    Args:
        P: (4, 4), the frame in which the whole view errs.
    """
    n = len(goals)
    # Columns of F are the axes of each ray in the frame of its part: two across and one along, of shifts and of turns.
    turned = np.swapaxes(goals[:, :3, :3], 1, 2) @ camera.frames(goals)
    own = np.zeros((4, n, 6, n, 3))
    for i, (row, columns) in enumerate(((0, (0, 1)), (0, (2,)), (3, (0, 1)), (3, (2,)))):
        for column in columns:
            own[i, np.arange(n), row : row + 3, np.arange(n), column] = turned[:, :, column]
    view = view_ways(goals, P)
    return (*(F.reshape(6 * n, 3 * n) for F in own), view[:, :3], view[:, 3:])


def view_ways(goals: Array, P: Array) -> Array:
    """What a twist of the whole view in the frame P makes of the body twists of goals, (6 n, 6), in mm and deg."""
    ways = pose.adjoint(pose.inverse(goals) @ P)
    return np.asarray((ways * LEVEL_UNITS / LEVEL_UNITS[:, None]).reshape(-1, 6))
