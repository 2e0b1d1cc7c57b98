"""Draw overlays on one moment: parts at other poses, hands, and names of faces."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from apo_bench.assembly import PartFace, Poses
from apo_bench.geometry import Array, Face, pose
from apo_bench.simulation.film.track import FilmMoment, Segment, read_part_poses
from apo_bench.simulation.scene import Scene, set_part_pose

Color = tuple[float, float, float]
HAND_M = 0.012  # radius of a hand
HAND_COLOR = (0.90, 0.70, 0.60)
OVERLAY_OPACITY = 0.4  # of parts drawn at other poses
_OFF_M = 0.004  # distance of a name from its flat face


class Overlay(NamedTuple):
    """Poses at which parts are drawn once more, such as estimated or true ones."""

    poses: Poses
    color: Color


class FilmSnapshot(NamedTuple):
    """One moment with its overlays."""

    segment: Segment
    moment: FilmMoment
    words: tuple[str, ...]
    faces: tuple[PartFace, ...]
    """Faces whose names are drawn."""
    overlays: tuple[Overlay, ...]


def draw_over(scene: Scene, snapshot: FilmSnapshot, drawn: Any) -> None:
    """Add the overlays of a snapshot to MuJoCo's abstract scene (`mjvScene`)."""
    for overlay in snapshot.overlays:
        _draw_parts(scene, overlay, drawn)
    for hand in snapshot.moment.hands:
        _geom(drawn, mujoco.mjtGeom.mjGEOM_SPHERE, HAND_M, hand, (*HAND_COLOR, 0.8))
    poses = read_part_poses(snapshot.segment, snapshot.moment)
    for face in snapshot.faces:
        at = pose.apply(poses[face.part], label_place(scene, face)[None])[0]
        named = _geom(drawn, mujoco.mjtGeom.mjGEOM_LABEL, 0.01, at, (0.1, 0.1, 0.1, 1.0))
        if named is not None:
            named.label = str(face)


def label_place(scene: Scene, of: PartFace) -> Array:
    """The position of a face's name, (3,), part frame, [m]: in front of a flat face, on the wall of a round one."""
    face = scene.scenario.assembly.face_of(of)
    if isinstance(face, Face):
        return np.asarray(face.outline.mean(axis=0) + _OFF_M * face.normal)
    return np.asarray(face.ends.mean(axis=0) + float(np.mean(face.radii)) * face.frame[:3, 0])


def _draw_parts(scene: Scene, overlay: Overlay, drawn: Any) -> None:
    """Add the parts of an overlay to the scene."""
    world = scene.work
    data = mujoco.MjData(world.model)
    for part, T in overlay.poses.items():
        if part in world.qpos:
            set_part_pose(world, data, part, T)
    mujoco.mj_kinematics(world.model, data)
    begin = drawn.ngeom  # geoms from here on belong to this overlay
    dynamic = int(mujoco.mjtCatBit.mjCAT_DYNAMIC)
    mujoco.mjv_addGeoms(world.model, data, mujoco.MjvOption(), mujoco.MjvPerturb(), dynamic, drawn)
    wanted = {world.free.index(part) for part in overlay.poses if part in world.qpos}
    for geom in drawn.geoms[begin : drawn.ngeom]:
        ours = geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and world.geom_part[geom.objid] in wanted
        # MuJoCo adds the whole world, so all other geoms become invisible.
        geom.rgba[:] = (*overlay.color, OVERLAY_OPACITY if ours else 0.0)


def _geom(drawn: Any, kind: Any, size: float, at: Array, rgba: Sequence[float]) -> Any:
    """Add a geom to the scene and return it; None if the scene is full."""
    if drawn.ngeom >= drawn.maxgeom:
        return None
    geom = drawn.geoms[drawn.ngeom]
    mujoco.mjv_initGeom(geom, kind, np.full(3, size), at, np.eye(3).ravel(), np.array(rgba, dtype=np.float32))
    drawn.ngeom += 1
    return geom
