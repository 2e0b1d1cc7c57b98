"""Draw over one moment: poses of parts, hands and names of faces."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from apo_bench.assembly import PartFace, Poses
from apo_bench.geometry import Array, Face, pose
from apo_bench.simulation.film.track import FilmMoment, Segment, read_part_poses
from apo_bench.simulation.scene import Scene, set_part_pose

Color = tuple[float, float, float]
HAND_M = 0.012
HAND_COLOR = (0.90, 0.70, 0.60)
OVERLAY_OPACITY = 0.4
_OFF_M = 0.004  # how far before a flat face its name stands


class Overlay(NamedTuple):
    """Parts drawn once more, at their estimated or true poses."""

    poses: Poses
    color: Color


class FilmSnapshot(NamedTuple):
    """One moment with what is laid over it."""

    segment: Segment
    moment: FilmMoment
    words: tuple[str, ...]
    faces: tuple[PartFace, ...]
    """Whose names are written on them."""
    overlays: tuple[Overlay, ...]


def draw_over(scene: Scene, snapshot: FilmSnapshot, drawn: Any) -> None:
    """Draw into an abstract scene of MuJoCo (`mjvScene`), after what it holds."""
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
    """Where the name of a face stands, (3,), frame of its part, [m]: before its middle, of a round one at its wall."""
    face = scene.scenario.assembly.face_of(of)
    if isinstance(face, Face):
        return np.asarray(face.outline.mean(axis=0) + _OFF_M * face.normal)
    return np.asarray(face.ends.mean(axis=0) + float(np.mean(face.radii)) * face.frame[:3, 0])


def _draw_parts(scene: Scene, overlay: Overlay, drawn: Any) -> None:
    world = scene.work
    data = mujoco.MjData(world.model)
    for part, T in overlay.poses.items():
        if part in world.qpos:
            set_part_pose(world, data, part, T)
    mujoco.mj_kinematics(world.model, data)
    begin = drawn.ngeom
    dynamic = int(mujoco.mjtCatBit.mjCAT_DYNAMIC)
    mujoco.mjv_addGeoms(world.model, data, mujoco.MjvOption(), mujoco.MjvPerturb(), dynamic, drawn)
    wanted = {world.free.index(part) for part in overlay.poses if part in world.qpos}
    for geom in drawn.geoms[begin : drawn.ngeom]:
        ours = geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and world.geom_part[geom.objid] in wanted
        geom.rgba[:] = (*overlay.color, OVERLAY_OPACITY if ours else 0.0)


def _geom(drawn: Any, kind: Any, size: float, at: Array, rgba: Sequence[float]) -> Any:
    if drawn.ngeom >= drawn.maxgeom:
        return None
    geom = drawn.geoms[drawn.ngeom]
    mujoco.mjv_initGeom(geom, kind, np.full(3, size), at, np.eye(3).ravel(), np.array(rgba, dtype=np.float32))
    drawn.ngeom += 1
    return geom
