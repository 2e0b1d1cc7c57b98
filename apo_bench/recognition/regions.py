"""The difference of two range images: where something appeared, and where something vanished."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry.arrays import Array

Mask = NDArray[np.bool_]
LEAST_M = 0.004
"""A difference below is no change: lower than any block, higher than noise and than small motions of standing parts."""
DEVIATIONS = 6.0
"""So many standard deviations of the smoothed difference are no change either."""
SMOOTHED = 0.42
"""Standard deviation of the median of 3 x 3 numbers over that of one."""
LEAST_PIXELS = 40
"""Regions that are smaller are edges of something that moved a little, or noise."""


class Regions(NamedTuple):
    """What changed between two images of one view; (height, width) each."""

    appeared: Mask
    """Something is nearer now."""
    vanished: Mask
    """Something that was nearer is gone."""
    change_m: Array
    """Median-filtered difference, after minus before; 0 where one of the two images has no value."""


def regions(before: Array, after: Array, noise_m: float) -> Regions:
    """Compare two range images (height, width) of one view, NaN where nothing was measured, [m].

    Lines that are one or two pixels wide are opened away: they are the edges of parts that were moved by less than a
    pixel or two, which go unnoticed, as they did for the range finder of the paper.

    Args:
        noise_m: Standard deviation of one value of one image.
    """
    from scipy.ndimage import binary_opening, median_filter

    difference = after - before
    known = np.isfinite(difference)
    change = median_filter(np.where(known, difference, 0.0), size=3)
    least = max(LEAST_M, DEVIATIONS * SMOOTHED * np.sqrt(2.0) * noise_m)
    square = np.ones((3, 3), dtype=np.bool_)
    masks = (large(binary_opening(sign * change > least, square)) for sign in (-1.0, 1.0))
    return Regions(*masks, change)


def large(mask: Mask, least: int = LEAST_PIXELS) -> Mask:
    """A mask without its small components."""
    from scipy.ndimage import label

    names, n = label(mask)
    size = np.bincount(names.ravel(), minlength=n + 1)
    size[0] = 0
    return np.asarray(size[names] >= least)
