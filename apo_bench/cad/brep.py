"""Solids of a STEP file as Open CASCADE reads them: surface and triangles of each face; in a process of its own."""

import os
import pickle
import resource
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from apo_bench.cad.raw import Place
from apo_bench.cad.step_tree import leaves_of, matrix_of, shapes_in
from apo_bench.geometry.arrays import Array

LIMIT_BYTES = 2_000_000_000
LIMIT_S = 20
ANGLE_RAD = 0.2
_SAGITTA = 1e-2
"""Of triangles: angle between neighbours, the same on walls around one axis; distance from the surface at most, as part
of the size of the solid."""
_MOST_SAMPLES = 600


class BrepFace(NamedTuple):
    """A face of a solid."""

    kind: str
    """`plane`, `cylinder`, `cone`, `sphere`, `torus`, or `free` for what is stored as another one."""
    point: Array
    """Of the plane or the axis, [mm]; of a free one, points on it, (k, 3)."""
    way: Array
    """Normal or axis; of a free one, its normals there, (k, 3)."""
    radius: float
    """At the point."""
    slope: float
    """By how much the radius grows along the axis."""
    corners: Array
    """(c, 3)."""
    triangles: Any
    """(t, 3), counter-clockwise seen from outside."""


class BrepSolid(NamedTuple):
    """A solid, or a shell that may be one."""

    name: str
    faces: tuple[BrepFace, ...]
    size: float
    """Volume, [mm^3]."""
    centroid: Array
    inertia: Array
    """About the centroid, [mm^5]."""
    places: tuple[Place, ...]


def solids_of(path: Path) -> list[BrepSolid]:
    """What a STEP file holds, each solid once with all of its places, in the order of the file."""
    found: dict[Any, tuple[str, Any, list[Place]]] = {}
    for leaf in leaves_of(path):
        key = leaf.shape.TShape()
        found.setdefault(key, (leaf.product, leaf.shape, []))[2].append(Place(leaf.name, leaf.T, leaf.color))
    return [solid for name, shape, places in found.values() for solid in _solids(name, shape, (*places,))]


def _solids(name: str, shape: Any, places: tuple[Place, ...]) -> Iterator[BrepSolid]:
    """The solids in a shape, and its shells that belong to none."""
    from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID

    every = [*shapes_in(shape, TopAbs_SOLID), *shapes_in(shape, TopAbs_SHELL, TopAbs_SOLID)]
    if not every and any(shapes_in(shape, TopAbs_FACE)):
        every = [shape]
    for i, each in enumerate(every, start=1):
        called = name if len(every) == 1 else f"{name}_{i}"
        yield BrepSolid(called, tuple(_faces(each)), *_matter(each), places)


def _matter(shape: Any) -> tuple[float, Array, Array]:
    """Volume, centroid, inertia about it."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    found = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, found)
    at = found.CentreOfMass()
    J = found.MatrixOfInertia()
    inertia = np.array([[J.Value(i, k) for k in range(1, 4)] for i in range(1, 4)])
    return found.Mass(), np.array([at.X(), at.Y(), at.Z()]), inertia


def _faces(shape: Any) -> Iterator[BrepFace]:
    from OCP.Bnd import Bnd_Box
    from OCP.BRepBndLib import BRepBndLib
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopoDS import TopoDS

    box = Bnd_Box()
    BRepBndLib.Add_s(shape, box, False)
    size = float(np.sqrt(box.SquareExtent())) if not box.IsVoid() else 1.0
    BRepMesh_IncrementalMesh(shape, _SAGITTA * size, False, ANGLE_RAD, False)
    for each in shapes_in(shape, TopAbs_FACE):
        yield _face(TopoDS.Face_s(each) if hasattr(TopoDS, "Face_s") else TopoDS.Face(each))


def _face(face: Any) -> BrepFace:
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_REVERSED
    from OCP.TopLoc import TopLoc_Location

    location = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, location)
    if mesh is None:
        return BrepFace("none", np.zeros(3), np.zeros(3), 0.0, 0.0, np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
    nodes = [mesh.Node(i) for i in range(1, mesh.NbNodes() + 1)]
    T = matrix_of(location.Transformation())
    corners = np.array([(p.X(), p.Y(), p.Z()) for p in nodes]) @ T[:3, :3].T + T[:3, 3]
    triangles = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)], dtype=np.int64) - 1
    triangles = triangles.reshape(-1, 3)
    if face.Orientation() == TopAbs_REVERSED:
        triangles = triangles[:, ::-1]
    return BrepFace(*_surface(face, mesh, triangles), corners, triangles)


def _surface(face: Any, mesh: Any, triangles: Any) -> tuple[str, Array, Array, float, float]:
    """Its kind and parameters."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface

    surface = BRepAdaptor_Surface(face)
    kind = str(surface.GetType()).rsplit("_", 1)[-1].lower()
    if kind == "plane":
        plane = surface.Plane()
        return "plane", _xyz(plane.Location()), _xyz(plane.Axis().Direction()), 0.0, 0.0
    if kind == "cylinder":
        cylinder = surface.Cylinder()
        return "cylinder", _xyz(cylinder.Location()), _xyz(cylinder.Axis().Direction()), cylinder.Radius(), 0.0
    if kind == "cone":
        cone = surface.Cone()
        slope = float(np.tan(cone.SemiAngle()))
        return "cone", _xyz(cone.Location()), _xyz(cone.Axis().Direction()), cone.RefRadius(), slope
    if kind in ("sphere", "torus") or not mesh.HasUVNodes():
        return kind if kind in ("sphere", "torus") else "other", np.zeros(3), np.zeros(3), 0.0, 0.0
    return "free", *_samples(surface, mesh, triangles), 0.0, 0.0


def _samples(surface: Any, mesh: Any, triangles: Any) -> tuple[Array, Array]:
    """Points on a surface and its normals there: at corners and middles of triangles."""
    from OCP.gp import gp_Pnt, gp_Vec

    nodes = [mesh.UVNode(i) for i in range(1, mesh.NbNodes() + 1)]
    uv = np.array([(p.X(), p.Y()) for p in nodes])
    every = np.concatenate([uv, uv[triangles].mean(axis=1)])
    points = []
    normals = []
    for u, v in every[:: -(-len(every) // _MOST_SAMPLES)]:
        point = gp_Pnt()
        along_u = gp_Vec()
        along_v = gp_Vec()
        surface.D1(float(u), float(v), point, along_u, along_v)
        n = np.cross(_xyz(along_u), _xyz(along_v))
        if np.linalg.norm(n) > 1e-12:
            points.append(_xyz(point))
            normals.append(n / np.linalg.norm(n))
    return np.array(points).reshape(-1, 3), np.array(normals).reshape(-1, 3)


def _xyz(each: Any) -> Array:
    return np.array([each.X(), each.Y(), each.Z()])


def serve(path: str, read: Callable[[Path], list[BrepSolid]] = solids_of) -> None:
    """Read a file with little memory and time, and write what it holds to the standard output, pickled.

    What the reader prints goes elsewhere.
    """
    out = os.dup(1)
    os.dup2(2, 1)
    limits = ((resource.RLIMIT_AS, LIMIT_BYTES), (resource.RLIMIT_CPU, LIMIT_S), (resource.RLIMIT_CORE, 0))
    for what, most in limits:
        with suppress(OSError, ValueError):
            resource.setrlimit(what, (most, most))
    try:
        found = pickle.dumps(read(Path(path)))
    except (MemoryError, RuntimeError, ValueError, TypeError) as error:
        sys.exit(f"{type(error).__name__}: {error}")
    with os.fdopen(out, "wb") as file:
        file.write(found)
