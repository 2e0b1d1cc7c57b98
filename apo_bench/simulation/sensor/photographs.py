"""Photographs of parts: colours by rendering; depth and masks by ray casts, which need no graphics."""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple, final

import mujoco
import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import Poses
from apo_bench.geometry import Array
from apo_bench.perception.depth_camera.range_finder import PinholeView
from apo_bench.simulation.scene import KeptRenderer, Scene, aim_camera, build_data
from apo_bench.simulation.sensor.rays import ModelRays

_SHADOW_TEXELS = 2048  # along a side of the shadow map; each covers 0.8 mm on the table, a pixel at 0.9 m 1.1 mm
_LIGHT_SPREAD = np.array([0.5, 0.5, 0.0])
"""Varied lights: largest change of their direction, relative to its vertical component."""
_BRIGHTNESS = 0.6, 1.3
"""Varied lights: range of their brightness, relative to the usual one."""
_FIXED_COLOR = 0.1, 0.95
"""Varied colours: range of red, green and blue of the fixed parts."""

Mask = NDArray[np.bool_]
Box = tuple[int, int, int, int]
"""Left, top, width and height, [pixels]."""


class Silhouette(NamedTuple):
    """The pixels that would show a part without the others."""

    mask: Mask
    """(height, width), those in the image."""
    pixels: int
    """How many there are, also outside the image."""
    box: Box
    """The box around them, which may reach beyond the image."""


class PrintedMark(NamedTuple):
    """A coloured rectangle on a part."""

    T: Array
    """(4, 4), frame of the part, [m]; its third axis points out of the surface."""
    half: Array
    """Half of its length, width and height, (3,), [m]."""
    color: tuple[float, ...]
    """Red, green and blue, from 0 to 1."""


Marks = Mapping[str, Sequence[PrintedMark]]
"""Part -> its marks."""


class Photograph(NamedTuple):
    """One image of a scene."""

    rgb: NDArray[np.uint8] | None
    """(height, width, 3); None without graphics."""
    depth: Array
    """(height, width), along the optical axis, [m]; infinite where nothing is."""
    visible: Mapping[str, Mask]
    """Movable part -> pixels that show it, (height, width)."""
    whole: Mapping[str, Silhouette]
    """Movable part -> its silhouette."""


@final
class Photographer:
    """Takes photographs of the parts of a scene without hands and arm."""

    def __init__(self, scene: Scene, view: PinholeView, colours: bool = True) -> None:
        """Prepare to take photographs of one size and opening angle.

        Args:
            scene: From `build_scene`.
            view: Any view with this size and angle.
            colours: Whether to render colours, which needs graphics.

        Raises:
            InputError: No graphics driver can be used.
        """
        self._scene = scene
        self._cast = ModelRays(scene.scenario.assembly.solids, 1e-3 * scene.clearance_mm)
        self._world = replace(scene.shown, model=copy.copy(scene.shown.model))  # whose lights and colours may change
        self._world.model.vis.global_.fovy = view.fov_deg  # of free cameras
        size = view.width, view.height
        self._renderer = KeptRenderer(self._world.model, *size, _SHADOW_TEXELS) if colours else None

    def vary(self, rng: np.random.Generator) -> None:
        """Draw other directions and brightnesses of the lights, and another colour of the fixed parts."""
        usual = self._scene.shown.model
        model = self._world.model
        model.light_dir[:] = usual.light_dir + _LIGHT_SPREAD * rng.uniform(-1.0, 1.0, usual.light_dir.shape)
        model.light_diffuse[:] = usual.light_diffuse * rng.uniform(*_BRIGHTNESS, (usual.nlight, 1))
        model.vis.headlight.ambient[:] = usual.vis.headlight.ambient * rng.uniform(*_BRIGHTNESS)
        is_fixed = self._world.geom_part >= len(self._world.free)
        model.geom_rgba[is_fixed, :3] = rng.uniform(*_FIXED_COLOR, 3)

    def take(self, view: PinholeView, poses: Poses, marks: Marks = MappingProxyType({})) -> Photograph:
        """Take a photograph of parts with marks at these poses, (4, 4), world, [m]; others are at their start."""
        every = {**self._scene.scenario.start, **poses}
        shape = view.height, view.width
        distance, index = self._cast(every, view.origin, view.rays)
        names = list(every)
        movable = self._scene.shown.free
        visible = {part: (index == names.index(part)).reshape(shape) for part in movable}
        return Photograph(
            self._render(view, every, marks),
            (distance * (view.rays @ view.T_world_view[:3, 2])).reshape(shape),
            visible,
            {part: self._silhouette(view, part, every[part]) for part in movable},
        )

    def close(self) -> None:
        """Free the renderer, before another one is made."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _render(self, view: PinholeView, poses: Poses, marks: Marks) -> NDArray[np.uint8] | None:
        """Render the colours with a free camera, whose image is upright as that of `look_at`."""
        if self._renderer is None:
            return None
        forward = view.T_world_view[:3, 2]
        azimuth = np.degrees(np.arctan2(forward[1], forward[0]))
        elevation = np.degrees(np.arcsin(forward[2]))
        camera: Any = aim_camera(view.origin + forward, 1.0, float(azimuth), float(elevation))
        placed = [(poses[part] @ each.T, each) for part, several in marks.items() for each in several]
        adjust = partial(_adjust_scene, upward=-view.T_world_view[:3, 1], marks=placed)
        return self._renderer.draw(build_data(self._world, self._scene, poses), camera, adjust)

    def _silhouette(self, view: PinholeView, part: str, T: Array) -> "Silhouette":
        """The pixels that show a part alone."""
        pixels = self._cast.find_pixels(part, T, view)
        mask = np.isfinite(pixels.fill_image(view.height, view.width))
        return Silhouette(mask, len(pixels.rows), find_box(pixels.rows, pixels.columns))


def _adjust_scene(scene: mujoco.MjvScene, upward: Array, marks: Sequence[tuple[Array, PrintedMark]]) -> None:
    """Give MuJoCo's abstract scene the exact upward direction of a view, which may be rolled, and marks.

    Args:
        marks: Poses, (4, 4), world, and marks; those for which the scene has no room are left out.
    """
    for camera in scene.camera:  # both eyes
        camera.up = upward
    for T, mark in marks[: scene.maxgeom - scene.ngeom]:
        rgba = np.array([*mark.color, 1.0], dtype=np.float32)
        geom = scene.geoms[scene.ngeom]
        mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_BOX, mark.half, T[:3, 3], T[:3, :3].ravel(), rgba)
        scene.ngeom += 1


def find_box(rows: NDArray[Any], columns: NDArray[Any]) -> Box:
    """The box around pixels, (n,) rows and columns: left, top, width and height; all -1 without pixels."""
    if not len(rows):
        return (-1, -1, -1, -1)
    left, top = int(columns.min()), int(rows.min())
    return left, top, int(columns.max()) - left + 1, int(rows.max()) - top + 1
