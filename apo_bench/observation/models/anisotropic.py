"""Noise of a camera that is worse along its line of sight: fixed in the world, so it turns with no part."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, final

import numpy as np

from apo_bench.assembly.goals import Demonstration, Observation
from apo_bench.assembly.topology import Assembly
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.observation.models.facts import Facts
from apo_bench.observation.models.isotropic import observe_displaced
from apo_bench.observation.models.level import Level

_ELEVATION_DEG, _AZIMUTH_DEG = 40.0, 25.0
"""Where the camera stands: so high above the table, and so far from the x axis of the world."""
ALONG, ACROSS = 3.0, 0.5
"""Standard deviation of a position over the level, along the line of sight and across it."""
OUT_OF_IMAGE, IN_IMAGE = 2.0**0.5, 0.5
"""Standard deviation of a turn over the level: about axes of the image plane, and about the line of sight."""


@final
@dataclass(frozen=True)
class Anisotropic:
    """Every goal is seen at `T exp(xi)`; turned into the world, xi is Gaussian with axes along and across the sight.

    A camera finds depth less well than the place in the image, and a turn that tilts a part out of the image less
    well than one within it. The geometric means of the factors, 0.91 for positions and 1 for turns, keep a level
    comparable with that of `isotropic`; the root mean square of a position is 1.8 times as large.

    The body covariance is R^t S R with S fixed in the world and R the rotation that was seen. That is exact: a turn
    leaves its own axis where it is, so the turn can be drawn first and the position then in the frame that is seen.
    """

    level: Level

    FACTS: ClassVar[Facts] = Facts(
        title="worse along one line of sight, the same for all parts",
        formula=(
            "T_seen = T exp(xi), xi = (R_seen^t S1 e, R^t S2 e')",
            f"S1 = L ({ACROSS:g} (I - s s^t) + {ALONG:g} s s^t)",
            f"S2 = L ({OUT_OF_IMAGE:.3g} (I - s s^t) + {IN_IMAGE:g} s s^t)",
        ),
        frame="of the world, in which the line of sight s is fixed",
        parameters=(
            f"s = down from {_ELEVATION_DEG:g} deg above the table, {_AZIMUTH_DEG:g} deg from the x axis",
            f"{ALONG:g} and {ACROSS:g}: position over the level, along s and across it",
            f"{OUT_OF_IMAGE:.3g} and {IN_IMAGE:g}: turn over the level, about axes across s and about s",
        ),
        states="R^t S S R with R as seen, which is exact",
    )

    def __call__(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Observation:
        sight, unit = line_of_sight(), rng.standard_normal((len(assembly), 6))
        place = self.level.mm * 1e-3 * _stretch(sight, ALONG, ACROSS)
        turn = np.radians(self.level.deg) * _stretch(sight, IN_IMAGE, OUT_OF_IMAGE)
        rotation = np.zeros((len(assembly), 6))
        rotation[:, 3:] = np.einsum("nji,nj->ni", demonstration.goals[:, :3, :3], unit[:, 3:] @ turn)
        R = (demonstration.goals @ pose.exp(rotation))[:, :3, :3]
        xi = np.concatenate([np.einsum("nji,nj->ni", R, unit[:, :3] @ place), rotation[:, 3:]], axis=1)
        covariance = np.zeros((len(assembly), 6, 6))
        covariance[:, :3, :3] = _in_body(R, place @ place)
        covariance[:, 3:, 3:] = _in_body(R, turn @ turn)
        return observe_displaced(assembly, demonstration, xi, covariance)


def line_of_sight() -> Array:
    """The direction in which the camera looks, world frame, (3,), of length 1: obliquely down."""
    up, round_z = np.radians(_ELEVATION_DEG), np.radians(_AZIMUTH_DEG)
    return -np.array([np.cos(up) * np.cos(round_z), np.cos(up) * np.sin(round_z), np.sin(up)])


def _stretch(axis: Array, along: float, across: float) -> Array:
    """The symmetric matrix (3, 3) that stretches by these factors along an axis and across it."""
    return across * np.eye(3) + (along - across) * np.outer(axis, axis)


def _in_body(R: Array, S: Array) -> Array:
    """R^t S R of every part, (n, 3, 3), symmetric to the last bit."""
    turned = np.einsum("nji,jk,nkl->nil", R, S, R)
    return np.asarray((turned + np.swapaxes(turned, 1, 2)) / 2)
