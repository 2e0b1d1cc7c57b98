"""The range finder: its pinhole views, where they stand, and what its sensor makes of true distances.

The difference of two range images: where something appeared or vanished, and how much of it a model explains.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import NamedTuple, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from apo_bench.depth_camera.distance import Shape, strike_distances
from apo_bench.geometry import Array, frozen, pose

VIEWED_POINT_M = (0.05, 0.0, 0.03)
"""The point of the table that all views look at."""


@final
@dataclass(frozen=True, eq=False)
class PinholeView:
    """A pinhole camera: its pose, and how it divides its picture into pixels."""

    T_world_view: Array
    """(4, 4), [m]; x to the right of the picture, y down, z along the optical axis."""
    width: int
    height: int
    fov_deg: float
    """Vertical opening angle."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_view", frozen(self.T_world_view, 4, 4))

    @property
    def origin(self) -> Array:
        """Where all rays begin, (3,), world, [m]."""
        return self.T_world_view[:3, 3]

    @cached_property
    def rays(self) -> Array:
        """Unit vectors through the middles of the pixels, row by row, (height * width, 3), world."""
        # A pixel at (u, v) looks along (u - middle, v - middle, focal), focal the distance of the picture in pixels.
        focal = self.height / 2 / np.tan(np.radians(self.fov_deg) / 2)
        v, u = np.mgrid[: self.height, : self.width]
        x = (u + 0.5 - self.width / 2) / focal
        y = (v + 0.5 - self.height / 2) / focal
        rays = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3) @ self.T_world_view[:3, :3].T
        return frozen(rays / np.linalg.norm(rays, axis=1, keepdims=True))


class RangeImage(NamedTuple):
    """One firing without any error: true distances, (views, height, width)."""

    distance: Array
    """Along the ray, [m]; infinite where nothing is."""
    cosine: Array
    """The cosine of the angle between the ray and the normal of what it strikes, 0 (grazing) to 1."""


def look_at(from_m: ArrayLike, at_m: ArrayLike) -> Array:
    """The pose (4, 4) of a camera that stands at a point, looks at another and holds its picture upright, [m]."""
    origin = np.asarray(from_m, dtype=np.float64)
    at = np.asarray(at_m, dtype=np.float64)
    z = (at - origin) / np.linalg.norm(at - origin)
    x = np.cross(z, (0.0, 0.0, 1.0))
    x /= np.linalg.norm(x)
    return pose.rigid(np.stack([x, np.cross(z, x), z], axis=1), origin)


@lru_cache(maxsize=4)
def _two_views(width: int = 400, height: int = 300) -> tuple[PinholeView, ...]:
    """From the left in front and from the right behind, 45 degrees high: together they see every side of a part.

    One view is not enough: of a stick that lies in a tower only its ends can be seen, and only one of them from
    either side. At 0.95 m a pixel is 3 mm wide.
    """
    reach = 0.67
    height_m = 0.67
    at = np.array(VIEWED_POINT_M)
    ways = (np.array([side * 0.707 * reach, side * 0.707 * reach, height_m]) for side in (1.0, -1.0))
    return tuple(PinholeView(look_at(at + way, at), width, height, 48.0) for way in ways)


@final
@dataclass(frozen=True, eq=False)
class RangeFinder:
    """A range finder and its errors. A level of L mm means a standard deviation of L mm per ray."""

    views: tuple[PinholeView, ...] = field(default_factory=_two_views)
    bias: float = 0.1
    """Standard deviation, over the level, of an error that all rays of one view and firing have in common: white noise
    averages out over a part, so this is what stays; a tenth, as repeated measurements of a fixed object differ by 0.1
    to 0.3 mm where one ray is good to a millimetre or two."""
    grazing_deg: float = 80.0
    """Surfaces that are seen more obliquely send nothing back."""
    dropouts: float = 0.01
    """Share of rays without an answer, at random."""

    def sense(self, image: RangeImage, level_m: float, rng: np.random.Generator) -> Array:
        """What the sensor says, (views, height, width), [m]; NaN where it says nothing.

        Unit draws are scaled by the level, so the same generator gives comparable errors at all levels.
        """
        unit = rng.standard_normal(image.distance.shape)
        common = rng.standard_normal(len(image.distance))[:, None, None]
        lost = rng.random(image.distance.shape) < self.dropouts
        lost |= (image.cosine < np.cos(np.radians(self.grazing_deg))) | ~np.isfinite(image.distance)
        return np.where(lost, np.nan, image.distance + level_m * (unit + self.bias * common))


Mask = NDArray[np.bool_]
_LEAST_M = 0.010
"""A difference below is no change. Half of the thinnest part: a part that was nudged sideways by 4 mm changes the
distance to a side that is seen at 60 degrees by 8 mm, which goes unnoticed."""
_DEVIATIONS = 6.0
"""Standard deviations of the smoothed difference that are no change either."""
_SMOOTHED = 0.46
"""Standard deviation of the median of three medians of three numbers over that of one."""
_CLOSE_M = 0.005
_CLOSE_DEVIATIONS = 2.5
"""A pixel agrees with a model within this, or so many standard deviations of one ray; noise in a smoothed image is half
of that."""
_AROUND = 12
"""Pixels around a region that a wrong model may cover."""
_LEAST_PIXELS = 40
_LEAST_WIDTH = 5
"""Regions that are smaller, or hold no square of so many pixels, 14 mm, are edges of something that moved a little."""


class Regions(NamedTuple):
    """What changed between two images of one view; (height, width) each."""

    appeared: Mask
    """Something is nearer now."""
    vanished: Mask
    """Something that was nearer is gone."""


def regions(before: Array, after: Array, noise_m: float) -> Regions:
    """Compare two range images (height, width) of one view, NaN where nothing was measured, [m].

    Lines that are few pixels wide are dropped: they are the edges of parts that were moved a little, which go
    unnoticed, as they did for the range finder of the paper.

    Args:
        noise_m: Standard deviation of one value of one image.
    """
    from scipy.ndimage import binary_opening

    with np.errstate(invalid="ignore"):
        difference = after - before
    change = median_filtered(np.where(np.isfinite(difference), difference, 0.0))
    # The difference of two images has sqrt(2) times the noise of one; smoothing leaves _SMOOTHED of that.
    least = max(_LEAST_M, _DEVIATIONS * _SMOOTHED * np.sqrt(2.0) * noise_m)
    square = np.ones((3, 3), dtype=np.bool_)
    appeared, vanished = (without_small(binary_opening(sign * change > least, square)) for sign in (-1.0, 1.0))
    return Regions(appeared, vanished)


def median_filtered(image: Array) -> Array:
    """The median of the medians of three neighbours in a row, in three rows; edges stay where they are."""
    padded = np.pad(image, 1, mode="edge")
    rows = _median(padded[:, :-2], padded[:, 1:-1], padded[:, 2:])
    return _median(rows[:-2], rows[1:-1], rows[2:])


def _median(a: Array, b: Array, c: Array) -> Array:
    return np.maximum(np.minimum(a, b), np.minimum(np.maximum(a, b), c))


def without_small(mask: Mask) -> Mask:
    """A mask without its small and its thin components."""
    from scipy.ndimage import binary_erosion, label

    names, n = label(mask)
    size = np.bincount(names.ravel(), minlength=n + 1)
    thick = np.zeros(n + 1, dtype=np.bool_)
    thick[names[binary_erosion(mask, np.ones((_LEAST_WIDTH, _LEAST_WIDTH), dtype=np.bool_))]] = True
    kept = thick & (size >= _LEAST_PIXELS)
    kept[0] = False
    return np.asarray(kept[names])


def share_explained(
    shape: Shape, T: Array, views: Sequence[PinholeView], images: Array, appeared: Sequence[Mask], noise_m: float
) -> float:
    """The share of pixels that agree with a model at T, 0 to 1, of those that appeared or that it should cover.

    Args:
        images: (views, height, width), measured distances, smoothed, [m].
        appeared: Per view.
    """
    close = max(_CLOSE_M, _CLOSE_DEVIATIONS * noise_m)
    good = 0
    bad = 0
    to = pose.inverse(T)
    for view, image, mask in zip(views, images, appeared, strict=True):
        pixels = _around(mask)
        measured = image.ravel()[pixels]
        pixels = pixels[np.isfinite(measured)]
        measured = measured[np.isfinite(measured)]
        expected, _ = strike_distances(shape, pose.apply(to, view.origin[None])[0], view.rays[pixels] @ T[:3, :3])
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
