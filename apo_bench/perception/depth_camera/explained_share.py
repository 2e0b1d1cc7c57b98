"""The score of a located model: the share of a change between two range images that it explains."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array
from apo_bench.perception.depth_camera.change_detection import Mask
from apo_bench.perception.depth_camera.range_finder import PinholeView
from apo_bench.perception.depth_camera.ray_caster import RayCaster

_AGREE_M = 0.005
"""A pixel agrees with a model if their distances differ by less than this."""
_AGREE_DEVIATIONS = 2.5
"""The same limit in standard deviations of one ray; the larger limit counts. Smoothing halves the noise."""
_MARGIN_PX = 12
"""Margin around a changed region, in pixels, in which a wrong model is penalised."""


def measure_explained_share(
    poses: Mapping[str, Array],
    cast: RayCaster,
    views: Sequence[PinholeView],
    images: Array,
    appeared: Sequence[Mask],
    noise_m: float,
) -> float:
    """The fraction, 0 to 1, of the compared pixels that agree with parts at these poses.

    Compared are the pixels that appeared, and those that the parts would hide though the image shows what is behind.

    Args:
        poses: Part -> (4, 4), world, [m].
        images: (views, height, width), measured distances, smoothed, [m].
        appeared: Per view, pixels that are nearer than before.
        noise_m: Standard deviation of one ray.
    """
    close = max(_AGREE_M, _AGREE_DEVIATIONS * noise_m)
    good = 0
    bad = 0
    for view, image, mask in zip(views, images, appeared, strict=True):
        pixels = _pixels_around(mask)
        measured = image.ravel()[pixels]
        pixels = pixels[np.isfinite(measured)]
        measured = measured[np.isfinite(measured)]
        expected, _ = cast(poses, view.origin, view.rays[pixels])
        new = mask.ravel()[pixels]
        # Bad pixels: new ones off the surface of the model, and old ones behind a surface that the model puts there.
        agrees = np.abs(expected - measured) < close
        good += int((new & agrees).sum())
        bad += int((new & ~agrees).sum() + (~new & (expected < measured - close)).sum())
    return good / max(1, good + bad)


def _pixels_around(mask: Mask) -> NDArray[np.int64]:
    """Flat indices of every second pixel of every second row in the rectangle around a region, with a margin."""
    height, width = mask.shape
    rows = np.flatnonzero(mask.any(axis=1))
    columns = np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return np.zeros(0, dtype=np.int64)
    v = np.arange(max(0, rows[0] - _MARGIN_PX), min(height, rows[-1] + 1 + _MARGIN_PX), 2)
    u = np.arange(max(0, columns[0] - _MARGIN_PX), min(width, columns[-1] + 1 + _MARGIN_PX), 2)
    return np.asarray((v[:, None] * width + u).ravel())
