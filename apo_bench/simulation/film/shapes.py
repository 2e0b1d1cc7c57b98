"""Convert one moment to coloured shapes, for viewers that do not use MuJoCo."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import mujoco
import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.simulation.film.overlay import FilmSnapshot, draw_over
from apo_bench.simulation.film.track import show_moment
from apo_bench.simulation.scene import Scene

_SECTIONS = 32  # around a cylinder
_DIVISIONS = 2  # subdivisions of a sphere
_MOST_GEOMS = 10_000  # of MuJoCo's abstract scene


class ShapeKind(NamedTuple):
    """The appearance of a shape, without its pose."""

    geom: int
    """Geom type of MuJoCo."""
    size: tuple[float, ...]
    """As in MuJoCo: half sizes, or radius and half length."""
    mesh: int
    """Id of the mesh; negative for other types."""
    rgba: tuple[float, ...]
    label: str
    """Text in place of a shape; empty for a shape."""


class Shape(NamedTuple):
    """A shape with its pose."""

    kind: ShapeKind
    at: Array
    """(7,): x, y, z [m], then a quaternion, w first."""


def shapes_of(scene: Scene, data: Any, snapshot: FilmSnapshot) -> Iterator[Shape]:
    """All visible shapes of a snapshot without planes; `data` is set to its moment."""
    model = scene.work.model
    show_moment(scene, data, snapshot.segment, snapshot.moment)
    drawn = mujoco.MjvScene(model, maxgeom=_MOST_GEOMS)
    every = int(mujoco.mjtCatBit.mjCAT_ALL)
    mujoco.mjv_updateScene(model, data, mujoco.MjvOption(), mujoco.MjvPerturb(), mujoco.MjvCamera(), every, drawn)
    draw_over(scene, snapshot, drawn)
    for geom in drawn.geoms[: drawn.ngeom]:
        if geom.rgba[3] > 0.0 and geom.type != mujoco.mjtGeom.mjGEOM_PLANE:
            size, rgba = (tuple(numbers.tolist()) for numbers in (geom.size, geom.rgba))
            T = np.eye(4)
            T[:3, :3] = geom.mat
            T[:3, 3] = geom.pos
            # MuJoCo's `dataid` is twice the id of the mesh
            yield Shape(ShapeKind(geom.type, size, geom.dataid // 2, rgba, geom.label), pose.pack(T))


def surface(model: Any, kind: ShapeKind) -> Any:
    """The triangles of a kind of shape as `trimesh.Trimesh`; None if it has no surface, such as a label."""
    from trimesh import Trimesh, creation

    size = np.array(kind.size)
    if kind.geom == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.mesh(kind.mesh)
        vertices = model.mesh_vert[mesh.vertadr[0] :][: mesh.vertnum[0]]
        faces = model.mesh_face[mesh.faceadr[0] :][: mesh.facenum[0]]
        return Trimesh(np.array(vertices), np.array(faces), process=False)
    if kind.geom == mujoco.mjtGeom.mjGEOM_BOX:
        return creation.box(2.0 * size)
    if kind.geom == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return creation.cylinder(size[0], 2.0 * size[2], sections=_SECTIONS)
    if kind.geom == mujoco.mjtGeom.mjGEOM_CAPSULE:
        solid = creation.capsule(2.0 * size[2], size[0], count=[_SECTIONS, _SECTIONS // 2])
        return solid.apply_translation(-solid.bounds.mean(axis=0))
    if kind.geom in (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_ELLIPSOID):
        return creation.icosphere(_DIVISIONS).apply_scale(size)
    return None
