"""Change detection: the regions in which two range images of one view differ."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array

Mask = NDArray[np.bool_]
_LEAST_M = 0.010
"""A smaller difference of distances is no change.

It is half of the thinnest part. A part shifted sideways by 4 mm changes the distance to a side at 60 degrees by 8 mm,
which is ignored.
"""
_DEVIATIONS = 6.0
"""A difference of fewer standard deviations of the smoothed difference is no change either."""
_SMOOTHED = 0.46
"""Standard deviation of the median of three medians of three numbers, relative to that of one number."""
_LEAST_PIXELS = 40
"""Regions with fewer pixels are ignored."""
_LEAST_WIDTH = 5
"""Regions that contain no square of this many pixels (14 mm) are ignored: they are edges of slightly moved parts."""


class Regions(NamedTuple):
    """The changed pixels between two images of one view."""

    appeared: Mask
    """(height, width), pixels that are nearer than before."""
    vanished: Mask
    """(height, width), pixels that are farther than before."""


def find_changed_regions(before: Array, after: Array, noise_m: float) -> Regions:
    """Compare two range images (height, width) of one view, NaN where nothing was measured, [m].

    Lines a few pixels wide are dropped: they are edges of slightly moved parts, which this sensor ignores, like the
    range finder of the paper.

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
    # change < 0 is nearer than before, change > 0 farther.
    appeared, vanished = (drop_small(binary_opening(sign * change > least, square)) for sign in (-1.0, 1.0))
    return Regions(appeared, vanished)


def filter_median(image: Array) -> Array:
    """Filter an image with the median of the three row medians of each 3 x 3 neighbourhood, which preserves edges."""
    padded = np.pad(image, 1, mode="edge")
    rows = _median(padded[:, :-2], padded[:, 1:-1], padded[:, 2:])
    return _median(rows[:-2], rows[1:-1], rows[2:])


def _median(a: Array, b: Array, c: Array) -> Array:
    """The elementwise median of three arrays."""
    return np.maximum(np.minimum(a, b), np.minimum(np.maximum(a, b), c))


def drop_small(mask: Mask) -> Mask:
    """Remove the connected components of a mask that are too small or too thin."""
    from scipy.ndimage import binary_erosion, label

    names, n = label(mask)
    size = np.bincount(names.ravel(), minlength=n + 1)
    thick = np.zeros(n + 1, dtype=np.bool_)
    thick[names[binary_erosion(mask, np.ones((_LEAST_WIDTH, _LEAST_WIDTH), dtype=np.bool_))]] = True
    kept = thick & (size >= _LEAST_PIXELS)
    kept[0] = False  # the background
    return np.asarray(kept[names])
