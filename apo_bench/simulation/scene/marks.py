"""Draw arrows and rings into a picture: directions in which a part may shift, and axes about which it may rotate."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, final

import mujoco
import numpy as np

from apo_bench.geometry import Array, freeze

_Color = tuple[float, float, float]
_WIDTH_M = 0.0035  # of arrows and rings
_PIECES = 48
"""Straight pieces of a ring."""
_SWEEP_RAD = np.radians(304.0)  # angle that a ring covers
_HEAD_M = 0.022  # length of the arrow head of a ring
_NAME_M = 0.011
"""Distance of a name beyond its mark."""
_NOWHERE = np.zeros(3)
_UPRIGHT = np.eye(3).ravel()


@final
@dataclass(frozen=True, eq=False)
class ShiftArrows:
    """Two arrows in opposite directions along an axis."""

    center: Array
    """(3,), world frame, [m]."""
    axis: Array
    """Unit vector, (3,), world frame."""
    inner_m: float
    """Distance from the centre at which they begin."""
    outer_m: float
    """Distance from the centre at which they end."""
    color: _Color
    name: str = ""

    def __post_init__(self) -> None:
        freeze(self, center=(3,), axis=(3,))

    @property
    def tips(self) -> Array:
        """Possible positions of the name, (2, 3), world frame."""
        return self.center + np.outer((-1.0, 1.0), (self.outer_m + _NAME_M) * self.axis)


@final
@dataclass(frozen=True, eq=False)
class TurnRing:
    """A ring about an axis with a gap towards `away`, and an arrow head at both ends."""

    center: Array
    """(3,), world frame, [m]."""
    axis: Array
    """Unit vector, (3,), world frame."""
    away: Array
    """(3,), world frame: direction of the gap."""
    radius_m: float
    color: _Color
    name: str = ""

    def __post_init__(self) -> None:
        freeze(self, center=(3,), axis=(3,), away=(3,))

    @property
    def tips(self) -> Array:
        """Possible position of the name, (1, 3), world frame: just outside the gap."""
        return (self.center - (self.radius_m + _NAME_M) * _frame(self)[0])[None]


@final
@dataclass(frozen=True, eq=False)
class Marks:
    """Arrows and rings to draw into a picture; pass it as `more` to a function that draws one."""

    marks: Sequence[ShiftArrows | TurnRing]

    def __call__(self, scene: Any) -> None:
        """Draw into MuJoCo's abstract scene (`mjvScene`)."""
        for mark in self.marks:
            if isinstance(mark, ShiftArrows):
                _shift(scene, mark)
            else:
                _turn(scene, mark)


def _shift(scene: Any, mark: ShiftArrows) -> None:
    """Draw both arrows of a mark."""
    for side in (-1.0, 1.0):
        tail, tip = (mark.center + side * far * mark.axis for far in (mark.inner_m, mark.outer_m))
        _connect(scene, mujoco.mjtGeom.mjGEOM_ARROW, tail, tip, mark.color)


def _turn(scene: Any, mark: TurnRing) -> None:
    """Draw a ring as capsules, with an arrow at both ends."""
    u, v = _frame(mark)
    angles = np.linspace(-_SWEEP_RAD / 2, _SWEEP_RAD / 2, _PIECES + 1)
    points = mark.center + mark.radius_m * (np.outer(np.cos(angles), u) + np.outer(np.sin(angles), v))
    for a, b in pairwise(points):
        _connect(scene, mujoco.mjtGeom.mjGEOM_CAPSULE, a, b, mark.color, _WIDTH_M / 2)
    # An arrow head at both ends, along the last piece of the ring there.
    for end, before in ((points[0], points[1]), (points[-1], points[-2])):
        along = (end - before) / np.linalg.norm(end - before)
        _connect(scene, mujoco.mjtGeom.mjGEOM_ARROW, end - 1e-3 * along, end + _HEAD_M * along, mark.color)


def _frame(mark: TurnRing) -> tuple[Array, Array]:
    """Unit vectors (u, v) across the axis of a ring, (3,) each; u points away from the gap."""
    u = mark.away - (mark.away @ mark.axis) * mark.axis
    if np.linalg.norm(u) < 1e-6:  # `away` is along the axis: any direction across it
        u = np.eye(3)[int(np.argmin(np.abs(mark.axis)))]
        u = u - (u @ mark.axis) * mark.axis
    u = -u / np.linalg.norm(u)
    return u, np.cross(mark.axis, u)


def _connect(scene: Any, kind: Any, a: Array, b: Array, color: _Color, width_m: float = _WIDTH_M) -> None:
    """Add a geom from point a to point b to the scene, unless it is full."""
    if scene.ngeom >= scene.maxgeom:
        return
    geom = scene.geoms[scene.ngeom]
    mujoco.mjv_initGeom(geom, kind, _NOWHERE, _NOWHERE, _UPRIGHT, np.array([*color, 1.0], dtype=np.float32))
    mujoco.mjv_connector(geom, kind, width_m, a, b)
    if kind == mujoco.mjtGeom.mjGEOM_ARROW:
        geom.size[2] *= 2.0  # MuJoCo draws it half as long
    geom.emission = 0.35
    geom.specular = 0.1
    scene.ngeom += 1


def project_to_pixels(points: Array, camera: Any, fovy_deg: float, width: int, height: int) -> Array:
    """The pixels, (k, 2), of world points, (k, 3), in a picture by a free camera; origin at the upper left corner."""
    a = np.radians(camera.azimuth)
    e = np.radians(camera.elevation)
    forward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([np.sin(a), -np.cos(a), 0.0])
    ray = points - (camera.lookat - camera.distance * forward)
    # pixels per metre at the depth of each point
    scale = height / 2 / np.tan(np.radians(fovy_deg) / 2) / (ray @ forward)
    return np.column_stack([width / 2 + scale * (ray @ right), height / 2 - scale * (ray @ np.cross(right, forward))])
