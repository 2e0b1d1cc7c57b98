"""Regions that differ between two range images."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array

Mask = NDArray[np.bool_]
_LEAST_M = 0.010
"""A difference below is no change. Half of the thinnest part: a part that was nudged sideways by 4 mm changes the
distance to a side that is seen at 60 degrees by 8 mm, which goes unnoticed."""
_DEVIATIONS = 6.0
"""Standard deviations of the smoothed difference that are no change either."""
_SMOOTHED = 0.46
"""Standard deviation of the median of three medians of three numbers over that of one."""
_LEAST_PIXELS = 40
_LEAST_WIDTH = 5
"""Regions that are smaller, or hold no square of so many pixels, 14 mm, are edges of something that moved a little."""


class Regions(NamedTuple):
    """What changed between two images of one view; (height, width) each."""

    appeared: Mask
    """Something is nearer now."""
    vanished: Mask
    """Something that was nearer is gone."""


def find_changed_regions(before: Array, after: Array, noise_m: float) -> Regions:
    """Compare two range images (height, width) of one view, NaN where nothing was measured, [m].

    Lines that are few pixels wide are dropped: they are the edges of parts that were moved a little, which go
    unnoticed, as they did for the range finder of the paper.

    Args:
        noise_m: Standard deviation of one value of one image.
    """
    from scipy.ndimage import binary_opening

    with np.errstate(invalid="ignore"):
        difference = after - before
    change = filter_median(np.where(np.isfinite(difference), difference, 0.0))
    # The difference of two images has sqrt(2) times the noise of one; smoothing leaves _SMOOTHED of that.
    least = max(_LEAST_M, _DEVIATIONS * _SMOOTHED * np.sqrt(2.0) * noise_m)
    square = np.ones((3, 3), dtype=np.bool_)
    appeared, vanished = (drop_small(binary_opening(sign * change > least, square)) for sign in (-1.0, 1.0))
    return Regions(appeared, vanished)


def filter_median(image: Array) -> Array:
    """The median of the medians of three neighbours in a row, in three rows; edges stay where they are."""
    padded = np.pad(image, 1, mode="edge")
    rows = _median(padded[:, :-2], padded[:, 1:-1], padded[:, 2:])
    return _median(rows[:-2], rows[1:-1], rows[2:])


def _median(a: Array, b: Array, c: Array) -> Array:
    return np.maximum(np.minimum(a, b), np.minimum(np.maximum(a, b), c))


def drop_small(mask: Mask) -> Mask:
    """A mask without its small and its thin components."""
    from scipy.ndimage import binary_erosion, label

    names, n = label(mask)
    size = np.bincount(names.ravel(), minlength=n + 1)
    thick = np.zeros(n + 1, dtype=np.bool_)
    thick[names[binary_erosion(mask, np.ones((_LEAST_WIDTH, _LEAST_WIDTH), dtype=np.bool_))]] = True
    kept = thick & (size >= _LEAST_PIXELS)
    kept[0] = False
    return np.asarray(kept[names])
