"""Arrows drawn into a picture: where a part may be shifted, and about what it may be turned."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, final

import mujoco
import numpy as np

from apo_bench.geometry import Array, freeze

_Color = tuple[float, float, float]
_WIDTH_M = 0.0035
_PIECES = 48
"""Straight pieces of a whole ring."""
_SWEEP_RAD = np.radians(304.0)
_HEAD_M = 0.022
_NAME_M = 0.011
"""How far beyond its mark a name stands."""
_NOWHERE = np.zeros(3)
_UPRIGHT = np.eye(3).ravel()


@final
@dataclass(frozen=True, eq=False)
class ShiftArrows:
    """Two arrows that point away from each other along an axis."""

    center: Array
    """(3,), world frame, [m]."""
    axis: Array
    """Unit vector, (3,), world frame."""
    inner_m: float
    """How far from the centre they begin."""
    outer_m: float
    """How far from it they end."""
    color: _Color
    name: str = ""

    def __post_init__(self) -> None:
        freeze(self, center=(3,), axis=(3,))

    @property
    def tips(self) -> Array:
        """Where the name of the arrows may stand, (2, 3)."""
        return self.center + np.outer((-1.0, 1.0), (self.outer_m + _NAME_M) * self.axis)


@final
@dataclass(frozen=True, eq=False)
class TurnRing:
    """A ring about an axis that is open towards `away`, with a head at both ends."""

    center: Array
    """(3,), world frame, [m]."""
    axis: Array
    """Unit vector, (3,), world frame."""
    away: Array
    """(3,), world frame: where the ring is open."""
    radius_m: float
    color: _Color
    name: str = ""

    def __post_init__(self) -> None:
        freeze(self, center=(3,), axis=(3,), away=(3,))

    @property
    def tips(self) -> Array:
        """Where the name of the ring may stand, (1, 3): at the opening, a little outside."""
        return (self.center - (self.radius_m + _NAME_M) * _frame(self)[0])[None]


@final
@dataclass(frozen=True, eq=False)
class Marks:
    """What is drawn into a picture."""

    marks: Sequence[ShiftArrows | TurnRing]
    opacity: float = 1.0
    """The opacity of the parts."""

    def __call__(self, scene: Any) -> None:
        """Draw into an abstract scene of MuJoCo (`mjvScene`)."""
        for geom in scene.geoms[: scene.ngeom]:
            if geom.category == mujoco.mjtCatBit.mjCAT_DYNAMIC:
                geom.rgba[3] *= self.opacity
        for mark in self.marks:
            if isinstance(mark, ShiftArrows):
                _shift(scene, mark)
            else:
                _turn(scene, mark)


def _shift(scene: Any, mark: ShiftArrows) -> None:
    for side in (-1.0, 1.0):
        tail, tip = (mark.center + side * far * mark.axis for far in (mark.inner_m, mark.outer_m))
        _connect(scene, mujoco.mjtGeom.mjGEOM_ARROW, tail, tip, mark.color)


def _turn(scene: Any, mark: TurnRing) -> None:
    u, v = _frame(mark)
    angles = np.linspace(-_SWEEP_RAD / 2, _SWEEP_RAD / 2, _PIECES + 1)
    points = mark.center + mark.radius_m * (np.outer(np.cos(angles), u) + np.outer(np.sin(angles), v))
    for a, b in pairwise(points):
        _connect(scene, mujoco.mjtGeom.mjGEOM_CAPSULE, a, b, mark.color, _WIDTH_M / 2)
    for end, before in ((points[0], points[1]), (points[-1], points[-2])):
        along = (end - before) / np.linalg.norm(end - before)
        _connect(scene, mujoco.mjtGeom.mjGEOM_ARROW, end - 1e-3 * along, end + _HEAD_M * along, mark.color)


def _frame(mark: TurnRing) -> tuple[Array, Array]:
    """Two unit vectors across the axis, the first away from the opening."""
    u = mark.away - (mark.away @ mark.axis) * mark.axis
    if np.linalg.norm(u) < 1e-6:
        u = np.eye(3)[int(np.argmin(np.abs(mark.axis)))]
        u = u - (u @ mark.axis) * mark.axis
    u = -u / np.linalg.norm(u)
    return u, np.cross(mark.axis, u)


def _connect(scene: Any, kind: Any, a: Array, b: Array, color: _Color, width_m: float = _WIDTH_M) -> None:
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
    """Where points of the world, (k, 3), are in a picture by a free camera, (k, 2), from the upper left corner."""
    a = np.radians(camera.azimuth)
    e = np.radians(camera.elevation)
    forward = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([np.sin(a), -np.cos(a), 0.0])
    ray = points - (camera.lookat - camera.distance * forward)
    scale = height / 2 / np.tan(np.radians(fovy_deg) / 2) / (ray @ forward)
    return np.column_stack([width / 2 + scale * (ray @ right), height / 2 - scale * (ray @ np.cross(right, forward))])
