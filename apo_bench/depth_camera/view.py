"""A pinhole view: which ray every pixel looks along."""

from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from apo_bench.geometry.arrays import Array, frozen


@final
@dataclass(frozen=True, eq=False)
class View:
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
        focal = self.height / 2 / np.tan(np.radians(self.fov_deg) / 2)
        v, u = np.mgrid[: self.height, : self.width]
        x = (u + 0.5 - self.width / 2) / focal
        y = (v + 0.5 - self.height / 2) / focal
        rays = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3) @ self.T_world_view[:3, :3].T
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        rays.flags.writeable = False
        return rays


def look_at(from_m: ArrayLike, at_m: ArrayLike) -> Array:
    """The pose (4, 4) of a camera that stands at a point, looks at another and holds its picture upright, [m]."""
    origin = np.asarray(from_m, dtype=np.float64)
    at = np.asarray(at_m, dtype=np.float64)
    z = (at - origin) / np.linalg.norm(at - origin)
    x = np.cross(z, (0.0, 0.0, 1.0))
    x /= np.linalg.norm(x)
    T = np.eye(4)
    T[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    T[:3, 3] = origin
    return T
