"""The simulated range finder: its two pinhole views and its measurement errors."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, final

import numpy as np
from numpy.typing import ArrayLike

from apo_bench.geometry import Array, copy_frozen, pose

VIEWED_POINT_M = (0.05, 0.0, 0.03)
"""The point of the table that all views look at."""
BIAS = 0.1
"""Standard deviation of the error that all rays of one view and image have in common, relative to that of one ray.

White noise averages out over a part, so this error remains. A tenth, since repeated measurements of a fixed object
differ by 0.1 to 0.3 mm where one ray is good to a millimetre or two.
"""
_GRAZING_DEG = 80.0
"""Surfaces hit at a larger angle to their normal give no reading."""
_DROPOUTS = 0.01
"""Fraction of rays without a reading, at random."""


@final
@dataclass(frozen=True, eq=False)
class PinholeView:
    """A pinhole camera: pose, size of the image in pixels and opening angle."""

    T_world_view: Array
    """(4, 4), [m]; x to the right of the image, y down, z along the optical axis."""
    width: int
    height: int
    fov_deg: float
    """Vertical opening angle."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_view", copy_frozen(self.T_world_view, 4, 4))

    @property
    def origin(self) -> Array:
        """The common origin of all rays, (3,), world, [m]."""
        return self.T_world_view[:3, 3]

    @property
    def focal(self) -> float:
        """Focal length, [pixels]."""
        return float(self.height / 2 / np.tan(np.radians(self.fov_deg) / 2))

    @property
    def K(self) -> Array:
        """The camera matrix, (3, 3), [pixels]; the middle of the first pixel is at (0, 0)."""
        middle = (self.width - 1) / 2, (self.height - 1) / 2
        return np.array([[self.focal, 0.0, middle[0]], [0.0, self.focal, middle[1]], [0.0, 0.0, 1.0]])

    @cached_property
    def rays(self) -> Array:
        """Unit vectors through the middles of the pixels, row by row, (height * width, 3), world."""
        v, u = np.mgrid[: self.height, : self.width]
        return copy_frozen(self.cast_through(u, v))

    def cast_through(self, u: Array, v: Array) -> Array:
        """Unit vectors through the middles of pixels, (n, 3), world.

        Args:
            u, v: Columns and rows, of any equal shape; they may be outside the image.
        """
        # The ray of pixel (u, v) is (u - middle, v - middle, focal), with the focal length in pixels.
        x = (u + 0.5 - self.width / 2) / self.focal
        y = (v + 0.5 - self.height / 2) / self.focal
        rays = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3) @ self.T_world_view[:3, :3].T
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


class RangeImage(NamedTuple):
    """Range images of all views at one time, without errors."""

    distance: Array
    """(views, height, width), true distance along each ray, [m]; infinite if the ray hits nothing."""
    cosine: Array
    """(views, height, width), cosine of the angle between the ray and the normal of the surface, 0 (grazing) to 1."""


def look_at(from_m: ArrayLike, at_m: ArrayLike) -> Array:
    """The pose (4, 4) of a camera at `from_m` whose optical axis points to `at_m`, with an upright image, [m]."""
    origin = np.asarray(from_m, dtype=np.float64)
    at = np.asarray(at_m, dtype=np.float64)
    z = (at - origin) / np.linalg.norm(at - origin)
    x = np.cross(z, (0.0, 0.0, 1.0))
    x /= np.linalg.norm(x)
    return pose.rigid(np.stack([x, np.cross(z, x), z], axis=1), origin)


def _make_two_views() -> tuple[PinholeView, ...]:
    """Two cameras on opposite sides of the viewed point, 400 x 300 pixels, opening angle 48 degrees."""
    reach = 0.67
    height_m = 0.67
    at = np.array(VIEWED_POINT_M)
    ways = (np.array([side * 0.707 * reach, side * 0.707 * reach, height_m]) for side in (1.0, -1.0))
    return tuple(PinholeView(look_at(at + way, at), 400, 300, 48.0) for way in ways)


VIEWS = _make_two_views()
"""Two opposite views, 45 degrees above the table: together they cover every side of a part.

One view is not enough: of a stick in a tower only the two ends are visible, each from one side only. At 0.95 m a pixel
is 3 mm wide.
"""


def simulate_range_image(image: RangeImage, level_m: float, rng: np.random.Generator) -> Array:
    """Add measurement errors and dropouts to true distances.

    Unit draws are scaled by the noise level, so equal seeds give proportional errors at all levels.

    Args:
        level_m: Standard deviation of one ray.

    Returns:
        (views, height, width), [m]; NaN where the sensor has no reading.
    """
    unit = rng.standard_normal(image.distance.shape)
    common = rng.standard_normal(len(image.distance))[:, None, None]
    lost = rng.random(image.distance.shape) < _DROPOUTS
    lost |= (image.cosine < np.cos(np.radians(_GRAZING_DEG))) | ~np.isfinite(image.distance)
    return np.where(lost, np.nan, image.distance + level_m * (unit + BIAS * common))
