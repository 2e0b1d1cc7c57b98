"""The range finder: where its views stand, and what its sensor makes of true distances."""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple, final

import numpy as np

from apo_bench.depth_camera.view import View, look_at
from apo_bench.geometry.arrays import Array

VIEWED_POINT_M = (0.05, 0.0, 0.03)
"""The point of the table that all views look at."""


class RangeImage(NamedTuple):
    """One firing without any error: true distances, (views, height, width)."""

    distance: Array
    """Along the ray, [m]; infinite where nothing is."""
    cosine: Array
    """The cosine of the angle between the ray and the normal of what it strikes, 0 (grazing) to 1."""


@lru_cache(maxsize=4)
def _two_views(width: int = 400, height: int = 300) -> tuple[View, ...]:
    """From the left in front and from the right behind, 45 degrees high: together they see every side of a part.

    One view is not enough: of a stick that lies in a tower only its ends can be seen, and only one of them from
    either side. At 0.95 m a pixel is 3 mm wide.
    """
    reach = 0.67
    height_m = 0.67
    at = np.array(VIEWED_POINT_M)
    ways = (np.array([side * 0.707 * reach, side * 0.707 * reach, height_m]) for side in (1.0, -1.0))
    return tuple(View(look_at(at + way, at), width, height, 48.0) for way in ways)


@final
@dataclass(frozen=True, eq=False)
class RangeFinder:
    """A range finder and its errors. A level of L mm means a standard deviation of L mm per ray."""

    views: tuple[View, ...] = field(default_factory=_two_views)
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
