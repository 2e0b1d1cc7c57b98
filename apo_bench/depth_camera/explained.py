"""How much of what changed a model explains, and how much it should hide that is still seen."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from apo_bench.depth_camera.distance import Shape, strike_distances
from apo_bench.depth_camera.regions import Mask
from apo_bench.depth_camera.view import View
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array

_CLOSE_M = 0.005
_DEVIATIONS = 2.5
"""Standard deviations of one ray; noise in a smoothed image is half of that."""
_AROUND = 12
"""Pixels around a region that a wrong model may cover."""


def share_explained(
    shape: Shape, T: Array, views: Sequence[View], images: Array, appeared: Sequence[Mask], noise_m: float
) -> float:
    """The share of pixels that agree with a model at T, 0 to 1, of those that appeared or that it should cover.

    Args:
        images: (views, height, width), measured distances, smoothed, [m].
        appeared: Per view.
    """
    close = max(_CLOSE_M, _DEVIATIONS * noise_m)
    good = bad = 0
    to = pose.inverse(T)
    for view, image, mask in zip(views, images, appeared, strict=True):
        pixels = _around(mask)
        measured = image.ravel()[pixels]
        pixels = pixels[np.isfinite(measured)]
        measured = measured[np.isfinite(measured)]
        origin = pose.apply(to, view.origin[None])[0]
        rays = view.rays[pixels] @ T[:3, :3]
        expected, _ = strike_distances(shape, origin, rays)
        new = mask.ravel()[pixels]
        agrees = np.abs(expected - measured) < close
        good += int((new & agrees).sum())
        bad += int((new & ~agrees).sum() + (~new & (expected < measured - close)).sum())
    return good / max(1, good + bad)


def _around(mask: Mask) -> NDArray[np.int64]:
    """Every second pixel of every second row in the rectangle around a region, by number."""
    height, width = mask.shape
    rows = np.flatnonzero(mask.any(axis=1))
    columns = np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return np.zeros(0, dtype=np.int64)
    v = np.arange(max(0, rows[0] - _AROUND), min(height, rows[-1] + 1 + _AROUND), 2)
    u = np.arange(max(0, columns[0] - _AROUND), min(width, columns[-1] + 1 + _AROUND), 2)
    return np.asarray((v[:, None] * width + u).ravel())
