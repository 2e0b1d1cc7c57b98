"""The share of a change between two range images that a model explains."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array
from apo_bench.perception.depth_camera.range_finder import PinholeView
from apo_bench.perception.depth_camera.rays import RayCaster
from apo_bench.perception.depth_camera.regions import Mask

_CLOSE_M = 0.005
_CLOSE_DEVIATIONS = 2.5
"""A pixel agrees with a model within this, or so many standard deviations of one ray; noise in a smoothed image is half
of that."""
_AROUND = 12
"""Pixels around a region that a wrong model may cover."""


def measure_share(
    poses: Mapping[str, Array],
    cast: RayCaster,
    views: Sequence[PinholeView],
    images: Array,
    appeared: Sequence[Mask],
    noise_m: float,
) -> float:
    """The share of pixels that agree with parts at these poses, 0 to 1, of those that appeared or that they hide.

    Args:
        images: (views, height, width), measured distances, smoothed, [m].
        appeared: Per view.
    """
    close = max(_CLOSE_M, _CLOSE_DEVIATIONS * noise_m)
    good = 0
    bad = 0
    for view, image, mask in zip(views, images, appeared, strict=True):
        pixels = _around(mask)
        measured = image.ravel()[pixels]
        pixels = pixels[np.isfinite(measured)]
        measured = measured[np.isfinite(measured)]
        expected, _ = cast(poses, view.origin, view.rays[pixels])
        new = mask.ravel()[pixels]
        # Against the model: what appeared and is not its surface, and what stayed though it would hide that.
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
