"""The range finder: pinhole views, and the errors of its sensor."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, final

import numpy as np
from numpy.typing import ArrayLike

from apo_bench.geometry import Array, copy_frozen, pose

VIEWED_POINT_M = (0.05, 0.0, 0.03)
"""The point of the table that all views look at."""
BIAS = 0.1
"""Standard deviation, over the level, of an error that all rays of one view and firing have in common: white noise
averages out over a part, so this is what stays; a tenth, as repeated measurements of a fixed object differ by 0.1 to
0.3 mm where one ray is good to a millimetre or two."""
_GRAZING_DEG = 80.0
"""Surfaces that are seen more obliquely send nothing back."""
_DROPOUTS = 0.01
"""Share of rays without an answer, at random."""


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
        object.__setattr__(self, "T_world_view", copy_frozen(self.T_world_view, 4, 4))

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
        return copy_frozen(rays / np.linalg.norm(rays, axis=1, keepdims=True))


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


def _two_views() -> tuple[PinholeView, ...]:
    reach = 0.67
    height_m = 0.67
    at = np.array(VIEWED_POINT_M)
    ways = (np.array([side * 0.707 * reach, side * 0.707 * reach, height_m]) for side in (1.0, -1.0))
    return tuple(PinholeView(look_at(at + way, at), 400, 300, 48.0) for way in ways)


VIEWS = _two_views()
"""From the left in front and from the right behind, 45 degrees high: together they cover every side of a part.

One view is not enough: of a stick that lies in a tower only its ends are visible, and only one of them from either
side. At 0.95 m a pixel is 3 mm wide.
"""


def sense(image: RangeImage, level_m: float, rng: np.random.Generator) -> Array:
    """Measure true distances with errors.

    Unit draws are scaled by the level, so the same generator gives comparable errors at all levels.

    Args:
        level_m: Standard deviation of a ray.

    Returns:
        (views, height, width), [m]; NaN where the sensor has no reading.
    """
    unit = rng.standard_normal(image.distance.shape)
    common = rng.standard_normal(len(image.distance))[:, None, None]
    lost = rng.random(image.distance.shape) < _DROPOUTS
    lost |= (image.cosine < np.cos(np.radians(_GRAZING_DEG))) | ~np.isfinite(image.distance)
    return np.where(lost, np.nan, image.distance + level_m * (unit + BIAS * common))
