"""What a world looks like, as triangles for viewers that know no MuJoCo: one shape for each body and colour."""

from collections import defaultdict
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array, pose
from apo_bench.simulation.scene import World

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
    model = world.model
    root = world.body[part]
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
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
