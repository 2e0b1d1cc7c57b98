"""What was seen of a demonstration or a replay, kept moment by moment; and what is shown at one moment of it.

What a world looks like, as triangles for viewers that know no MuJoCo: one shape for each body and colour.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, final

import mujoco
import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly import PartFace, Plan, Poses, placements
from apo_bench.geometry import Array, Face, frozen, pose
from apo_bench.simulation.hooks import Doing, Hooks
from apo_bench.simulation.scene import Scene, World, arm_home, initial_state, place, place_for_picture

NO_HANDS = frozen(np.zeros((0, 3)), None, 3)
Color = tuple[float, float, float]
IN_PLACE = "in place"
HAND_M = 0.012
HAND_COLOR = (0.90, 0.70, 0.60)
GHOST_OPACITY = 0.4
_OFF_M = 0.004
"""How far before a flat face its name stands."""


class FilmMoment(NamedTuple):
    """A state of a world, and what is done in it."""

    time_s: float
    qpos: Array
    doing: Doing
    hands: Array
    """Where the hands of the human are, (2, 3), [m]; of a replay (0, 3)."""


@final
@dataclass(frozen=True, eq=False)
class Chapter:
    """A demonstration or a replay from its beginning to its end."""

    title: str
    world: World
    start: Poses
    """Before the first moment; what is fixed stays there."""
    moments: tuple[FilmMoment, ...]
    ending: str
    """What came of it, in a sentence."""
    good: bool | None
    """Whether that is a success; None where nobody asks."""


@final
@dataclass(eq=False)
class FilmTrack:
    """Keeps a demonstration or a replay: pass its `hooks` as `watch`."""

    plan: Plan | None = None
    """What is replayed; None of a demonstration."""
    moments: list[FilmMoment] = field(default_factory=list)

    @property
    def hooks(self) -> Hooks:
        return Hooks(before_replay=self._begin, after_tick=self._keep)

    def _begin(self, plan: Plan) -> None:
        self.plan = plan

    def _keep(self, data: Any, doing: Doing) -> None:
        self.moments.append(FilmMoment(float(data.time), np.array(data.qpos), doing, np.array(data.mocap_pos)))


class Ghost(NamedTuple):
    """Parts drawn once more, where they are believed or should be."""

    name: str
    poses: Poses
    color: Color


class Still(NamedTuple):
    """One moment with what is laid over it."""

    chapter: Chapter
    moment: FilmMoment
    words: tuple[str, ...]
    faces: tuple[PartFace, ...]
    """Whose names are written on them."""
    ghosts: tuple[Ghost, ...]


def scenario_chapter(scene: Scene, start: Poses, goals: Array) -> Chapter:
    """What a scenario asks for: the parts before the first operation and after each, a second apart."""
    world = scene.work
    data = initial_state(world, start)
    moments = list[FilmMoment]()
    arm_home(scene, data)
    for k, poses in enumerate((start, *placements(scene.scenario.assembly, start, goals)), start=-1):
        for part in world.free:
            place(world, data, part, poses[part])
        doing = Doing(None if k < 0 else k, IN_PLACE, 0.0)
        moments.append(FilmMoment(k + 1.0, np.array(data.qpos), doing, NO_HANDS))
    return Chapter(f"{scene.scenario.name}: as the scenario asks", world, start, tuple(moments), "", None)


def part_poses(chapter: Chapter, moment: FilmMoment) -> Poses:
    """Where every part is, world frame, [m]."""
    free = {part: pose.unpack(moment.qpos[a : a + 7]) for part, a in chapter.world.qpos.items()}
    return {**{part: chapter.start[part] for part in chapter.world.fixed}, **free}


def show_moment(scene: Scene, data: Any, chapter: Chapter, moment: FilmMoment) -> None:
    """Bring a state of the world of the robot to a moment; while a human demonstrates, the arm is at home."""
    if chapter.world is scene.work:
        data.qpos[:] = moment.qpos
    else:
        arm_home(scene, data)
        for part, T in part_poses(chapter, moment).items():
            if part in scene.work.qpos:
                place(scene.work, data, part, T)
    place_for_picture(scene.work.model, data)


def draw_over(scene: Scene, still: Still, drawn: Any) -> None:
    """Draw ghosts, hands and names of faces into an abstract scene of MuJoCo (`mjvScene`), after what it holds."""
    for ghost in still.ghosts:
        _draw_ghost(scene, ghost, drawn)
    for hand in still.moment.hands:
        _geom(drawn, mujoco.mjtGeom.mjGEOM_SPHERE, HAND_M, hand, (*HAND_COLOR, 0.8))
    poses = part_poses(still.chapter, still.moment)
    for face in still.faces:
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


def _draw_ghost(scene: Scene, ghost: Ghost, drawn: Any) -> None:
    world = scene.work
    model = scene.work.model
    data = mujoco.MjData(model)
    for part, T in ghost.poses.items():
        if part in world.qpos:
            place(world, data, part, T)
    mujoco.mj_kinematics(model, data)
    begin = drawn.ngeom
    wanted = {world.free.index(part) for part in ghost.poses if part in world.qpos}
    dynamic = int(mujoco.mjtCatBit.mjCAT_DYNAMIC)
    mujoco.mjv_addGeoms(model, data, mujoco.MjvOption(), mujoco.MjvPerturb(), dynamic, drawn)
    for geom in drawn.geoms[begin : drawn.ngeom]:
        ours = geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and world.geom_part[geom.objid] in wanted
        geom.rgba[:] = (*ghost.color, GHOST_OPACITY if ours else 0.0)


def _geom(drawn: Any, kind: Any, size: float, at: Array, rgba: Sequence[float]) -> Any:
    if drawn.ngeom >= drawn.maxgeom:
        return None
    geom = drawn.geoms[drawn.ngeom]
    mujoco.mjv_initGeom(geom, kind, np.full(3, size), at, np.eye(3).ravel(), np.array(rgba, dtype=np.float32))
    drawn.ngeom += 1
    return geom


_AROUND = 32
_BALLS = 2
"""Pieces around a cylinder; how often a ball is divided."""
_SHOWN_GROUPS = 3
"""MuJoCo shows the geoms of groups 0 to 2."""


class BodyMesh(NamedTuple):
    """A surface that moves with a body."""

    body: int
    part: str | None
    """The part that it belongs to; None of the arm."""
    vertices: Array
    """(n, 3), frame of the body, [m]."""
    triangles: NDArray[np.int64]
    """(m, 3), into the vertices."""
    rgba: tuple[float, float, float, float]


def body_meshes(world: World) -> tuple[BodyMesh, ...]:
    """Everything that is drawn of a world, planes excepted."""
    model = world.model
    meshes = defaultdict[Any, list[tuple[Array, NDArray[np.int64]]]](list)
    parts = (*world.free, *world.fixed)
    for geom in range(model.ngeom):
        mesh = _mesh(model, geom)
        rgba = _color(model, geom)
        if mesh is None or rgba[3] == 0.0 or model.geom_group[geom] >= _SHOWN_GROUPS:
            continue
        T = pose.unpack([*model.geom_pos[geom], *model.geom_quat[geom]])
        owner = int(world.geom_part[geom])
        key = (int(model.geom_bodyid[geom]), None if owner < 0 else parts[owner], rgba)
        meshes[key].append((pose.apply(T, mesh[0]), mesh[1]))
    return tuple(BodyMesh(body, part, *_joined(each), rgba) for (body, part, rgba), each in meshes.items())


def body_poses(data: Any) -> Array:
    """Where every body of a world is, (bodies, 7): x, y, z [m], then a quaternion, w first."""
    return np.hstack([data.xpos, data.xquat])


def part_meshes(world: World, part: str) -> tuple[BodyMesh, ...]:
    """The meshes of one part, in the frame of the part."""
    root = world.body[part]
    data = mujoco.MjData(world.model)
    mujoco.mj_kinematics(world.model, data)
    inverse = pose.inverse(pose.unpack([*data.xpos[root], *data.xquat[root]]))
    moved = []
    for mesh in body_meshes(world):
        if mesh.part == part:
            T = inverse @ pose.unpack([*data.xpos[mesh.body], *data.xquat[mesh.body]])
            moved.append(mesh._replace(body=root, vertices=pose.apply(T, mesh.vertices)))
    return tuple(moved)


def _joined(meshes: list[tuple[Array, NDArray[np.int64]]]) -> tuple[Array, NDArray[np.int64]]:
    before = np.cumsum([0, *(len(vertices) for vertices, _ in meshes[:-1])])
    triangles = [mesh[1] + offset for mesh, offset in zip(meshes, before, strict=True)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(triangles)


def _color(model: Any, geom: int) -> tuple[float, float, float, float]:
    material = int(model.geom_matid[geom])
    rgba = model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]
    r, g, b, a = (float(x) for x in rgba)
    return r, g, b, a


def _mesh(model: Any, geom: int) -> tuple[Array, NDArray[np.int64]] | None:
    """Vertices (n, 3) and triangles (m, 3) of a geom in its own frame; None of what is no body."""
    from trimesh import creation

    kind = mujoco.mjtGeom(model.geom_type[geom])
    size = model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        i = int(model.geom_dataid[geom])
        v = int(model.mesh_vertadr[i])
        n = int(model.mesh_vertnum[i])
        f = int(model.mesh_faceadr[i])
        m = int(model.mesh_facenum[i])
        return np.array(model.mesh_vert[v : v + n], float), np.array(model.mesh_face[f : f + m], np.int64)
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        solid = creation.box(2.0 * size)
    elif kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        solid = creation.cylinder(size[0], 2.0 * size[1], sections=_AROUND)
    elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        solid = creation.capsule(2.0 * size[1], size[0], count=[_AROUND, _AROUND // 2])
        solid.apply_translation([0.0, 0.0, -solid.bounds.mean(axis=0)[2]])
    elif kind in (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_ELLIPSOID):
        solid = creation.icosphere(_BALLS)
        solid.apply_scale(size if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID else size[0])
    else:
        return None
    return np.asarray(solid.vertices, float), np.asarray(solid.faces, np.int64)
