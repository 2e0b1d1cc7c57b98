"""The picture at the top: a UR5e with observed poses and with corrected ones, each with the hole along the stick.

Both are states of a replay. The inset hides the arm and the stick; the yellow line is the outline of the stick at the
hole entrance, and red is where its end meets a face of a castle.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import mujoco
import numpy as np
from matplotlib.patches import ConnectionPatch, Polygon, Rectangle
from numpy.typing import NDArray
from shapely.geometry import MultiPoint
from shapely.ops import unary_union

from apo_bench.assembly import Plan
from apo_bench.geometry import Array
from apo_bench.simulation.scene.render import aim_camera, picture_with_arm
from apo_bench.simulation.scene.scene import Scene
from apo_bench.trial.stages import replay_and_judge

ARM = "ur5e_primitive"
GRIPPER = "arm/gripper/base"
SIZE = (1560, 1120)
CLOSE = (760, 760)
"""Width and height of the whole and of the inset [px]."""
WIDE_DEG = 38.0
NARROW_DEG = 9.0
"""Vertical angle of view of the two."""
HALF_M = 0.03
"""Of a castle, along the hole."""
HOLE_M = 0.04
NEAR_M = 0.01
HELD_M = 0.3
"""Height of the hole above the table, how near the stick is to its axis while it goes in, and to the gripper."""
INSET = (0.645, 0.475, 0.35, 0.515)
"""In the whole: left, bottom, width, height, as shares."""
BOX = 68
"""Half of the frame about the tower [px]."""
JAMS = "#d7263d"
FITS = "#2a9d4a"


class View(NamedTuple):
    """A camera that looks at a point from a distance."""

    at: Array
    distance_m: float
    azimuth_deg: float
    elevation_deg: float
    fovy_deg: float
    size: tuple[int, int]

    def pixels(self, points: Array) -> Array:
        """Where points of the world, (n, 3), are in the picture, (n, 2), from its upper left corner."""
        az, el = np.radians((self.azimuth_deg, self.elevation_deg))
        ahead = np.array([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])
        right = np.cross(ahead, (0.0, 0.0, 1.0)) / np.cos(el)
        off = points - (self.at - self.distance_m * ahead)
        scale = self.size[1] / 2 / np.tan(np.radians(self.fovy_deg / 2)) / (off @ ahead)
        x = off @ right * scale
        y = off @ np.cross(right, ahead) * scale
        return np.stack([self.size[0] / 2 + x, self.size[1] / 2 - y], axis=1)


class Shot(NamedTuple):
    """One half of the picture."""

    title: str
    said: str
    color: str
    whole: NDArray[np.uint8]
    tower: Array
    """The middle of the hole in the whole, (2,) [px]."""
    close: NDArray[np.uint8]
    end: Array
    """The end of the stick in the inset, (n, 2) [px]."""
    meets: Sequence[Array]
    """Where it meets a castle, polygons (n, 2) [px]."""


def shot(scene: Scene, plan: Plan, reference: Array, title: str, said: str, color: str) -> Shot:
    """The state of a replay at which the stick is as far in as it comes."""
    model = scene.work.model
    data = mujoco.MjData(scene.work.model)
    data.qpos[:] = state = deepest(scene, plan, reference)
    mujoco.mj_forward(model, data)
    along = reference[0][:3, 0]
    turn = float(np.degrees(np.arctan2(along[1], along[0])))
    hole = reference[0][:3, 3] + [0.0, 0.0, HOLE_M]
    middle = hole + np.array([-0.165, -0.03, 0.215])
    wide = View(middle, 1.3, turn + 62.0, -15.0, WIDE_DEG, SIZE)
    narrow = View(hole, 0.35, turn, 0.0, NARROW_DEG, CLOSE)
    end = narrow.pixels(at_mouth(face(model, data, "stick/bar", along), data.body("stick/").xmat[::3], hole, along))
    shape = MultiPoint(end).convex_hull
    bodies = [model.geom(g).name for g in range(model.ngeom)]
    near = [narrow.pixels(face(model, data, name, -along)) for name in bodies if name.startswith("castle")]
    meets = shape.intersection(unary_union([MultiPoint(corners).convex_hull for corners in near]))
    parts = [part for part in getattr(meets, "geoms", [meets]) if part.area > 0]
    return Shot(
        title,
        said,
        color,
        photo(scene, state, wide),
        wide.pixels(hole[np.newaxis])[0],
        photo(scene, state, narrow, hidden=("arm/", "stick/")),
        np.array(shape.exterior.coords),
        [np.array(part.exterior.coords) for part in parts],
    )


def deepest(scene: Scene, plan: Plan, reference: Array) -> Array:
    """The state of the replay at which the stick, still in the gripper, is as far in as it comes."""
    model = scene.work.model
    stick = model.body("stick/").id
    gripper = model.body(GRIPPER).id
    along = reference[0][:3, 0]
    across = reference[0][:3, 1]
    hole = reference[0][:3, 3] + [0.0, 0.0, HOLE_M]
    best: list[tuple[float, Array]] = []

    def watch(data: Any) -> None:
        held = np.linalg.norm(data.xpos[stick] - data.xpos[gripper]) < HELD_M
        off = data.xpos[stick] - hole
        before_it = max(abs(off[2]), abs(across @ off)) < NEAR_M
        depth = float(along @ off)
        if held and before_it and (not best or depth > best[-1][0]):
            best.append((depth, np.array(data.qpos)))

    replay_and_judge(plan, scene, reference, watch)
    return best[-1][1]


def face(model: Any, data: Any, geom: str, towards: Array) -> Array:
    """The four corners of a box that are farthest in a direction, (4, 3)."""
    number = model.geom(geom).id
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = data.geom_xpos[number] + signs * model.geom_size[number] @ data.geom_xmat[number].reshape(3, 3).T
    return corners[np.argsort(corners @ towards)[-4:]]


def at_mouth(corners: Array, axis: Array, hole: Array, along: Array) -> Array:
    """Corners of the end of the stick, moved along it to the plane in which the hole begins, (4, 3)."""
    left = (hole - HALF_M * along - corners) @ along / (axis @ along)
    return corners + left[:, None] * axis


def photo(scene: Scene, state: Array, view: View, hidden: tuple[str, ...] = ()) -> NDArray[np.uint8]:
    """The scene in a state, without bodies whose names begin so."""
    model = scene.work.model
    kept = model.geom_rgba.copy(), float(model.vis.global_.fovy), model.vis.headlight.ambient.copy()
    for geom in range(model.ngeom):
        if hidden and model.body(model.geom_bodyid[geom]).name.startswith(hidden):
            model.geom_rgba[geom, 3] = 0.0
    model.vis.global_.fovy = view.fovy_deg
    model.vis.headlight.ambient[:] = 0.45 if hidden else 0.25
    model.vis.global_.offwidth, model.vis.global_.offheight = SIZE
    camera = aim_camera(view.at, view.distance_m, view.azimuth_deg, view.elevation_deg)
    image = picture_with_arm(scene, scene.scenario.start, state, *view.size, camera)
    model.geom_rgba[:], model.vis.global_.fovy, model.vis.headlight.ambient[:] = kept
    return image


def draw_top(shots: Sequence[Shot], path: Path) -> None:
    """Both halves beside each other."""
    figure, axes = plt.subplots(1, 2, figsize=(13.0, 5.3), layout="constrained")
    for axis, half in zip(axes, shots, strict=True):
        axis.imshow(half.whole, interpolation="antialiased")
        axis.set_title(half.title, fontsize=23, fontweight="bold", pad=10)
        axis.axis("off")
        inset = axis.inset_axes(INSET)
        draw_close(inset, half)
        box = Rectangle(half.tower - BOX, 2 * BOX, 2 * BOX, fill=False, edgecolor=half.color, linewidth=2.2)
        axis.add_patch(box)
        for corner, x in ((0.0, -BOX), (1.0, BOX)):
            ends = {"xyA": (corner, 0.0), "coordsA": inset.transAxes, "xyB": half.tower + np.array([x, -BOX])}
            line = ConnectionPatch(**ends, coordsB=axis.transData, color=half.color, linewidth=1.4)
            axis.add_artist(line)
    figure.savefig(path, dpi=120, bbox_inches="tight", pad_inches=0.08)
    plt.close(figure)


def draw_close(axis: Any, half: Shot) -> None:
    """The faces of the hole, the end of the stick, and where they meet."""
    axis.imshow(half.close, interpolation="antialiased")
    axis.add_patch(Polygon(half.end, closed=True, facecolor="#e8c954", alpha=0.45, edgecolor="none"))
    for corners in half.meets:
        axis.add_patch(Polygon(corners, closed=True, facecolor=JAMS, edgecolor="none", alpha=0.95))
    axis.add_patch(Polygon(half.end, closed=True, fill=False, edgecolor="#ffe46b", linewidth=3.0))
    white = {"color": "white", "fontsize": 13.0, "fontweight": "bold"}
    axis.text(0.5, 0.965, "seen along the stick", va="top", ha="center", transform=axis.transAxes, **white)
    axis.text(0.5, 0.045, half.said, va="bottom", ha="center", transform=axis.transAxes, **white)
    axis.set_xticks([])
    axis.set_yticks([])
    for spine in axis.spines.values():
        spine.set(color=half.color, linewidth=3.0)
