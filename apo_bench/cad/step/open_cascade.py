"""Solids of a STEP file as Open CASCADE reads them: surface and triangles of each face; in a process of its own."""

import os
import pickle
import resource
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from OCP import Bnd, BRep, BRepAdaptor, BRepBndLib, BRepGProp, BRepMesh, GProp, TopAbs, TopLoc, TopoDS, gp

from apo_bench.cad.solids.raw_solid import SolidPlace
from apo_bench.cad.step.step_tree import leaves_of, matrix_of, shapes_in
from apo_bench.cad.step.surfaces import READER_BYTES, READER_S, TRIANGLES_RAD, BrepFace, BrepSolid
from apo_bench.geometry import Array

_SAGITTA = 1e-2
"""Distance of triangles from the surface at most, as part of the size of the solid."""
_MOST_SAMPLES = 600


def solids_of(path: Path) -> list[BrepSolid]:
    """What a STEP file holds, each solid once with all of its places, in the order of the file."""
    shapes: dict[Any, tuple[str, Any, list[SolidPlace]]] = {}
    for leaf in leaves_of(path):
        _, _, places = shapes.setdefault(leaf.shape.TShape(), (leaf.product, leaf.shape, []))
        places.append(SolidPlace(leaf.name, leaf.T, leaf.color))
    return [solid for name, shape, places in shapes.values() for solid in _solids(name, shape, (*places,))]


def _solids(name: str, shape: Any, places: tuple[SolidPlace, ...]) -> Iterator[BrepSolid]:
    """The solids in a shape, and its shells that belong to none."""
    every = [*shapes_in(shape, TopAbs.TopAbs_SOLID), *shapes_in(shape, TopAbs.TopAbs_SHELL, TopAbs.TopAbs_SOLID)]
    if not every and any(shapes_in(shape, TopAbs.TopAbs_FACE)):
        every = [shape]
    for i, each in enumerate(every, start=1):
        own_name = name if len(every) == 1 else f"{name}_{i}"
        yield BrepSolid(own_name, tuple(_faces(each)), *_mass_properties(each), places)


def _mass_properties(shape: Any) -> tuple[float, Array, Array]:
    """Volume, centroid, inertia about it."""
    properties = GProp.GProp_GProps()
    BRepGProp.BRepGProp.VolumeProperties_s(shape, properties)
    J = properties.MatrixOfInertia()
    inertia = np.array([[J.Value(i, k) for k in range(1, 4)] for i in range(1, 4)])
    return properties.Mass(), _xyz(properties.CentreOfMass()), inertia


def _faces(shape: Any) -> Iterator[BrepFace]:
    box = Bnd.Bnd_Box()
    BRepBndLib.BRepBndLib.Add_s(shape, box, False)
    size = float(np.sqrt(box.SquareExtent())) if not box.IsVoid() else 1.0
    BRepMesh.BRepMesh_IncrementalMesh(shape, _SAGITTA * size, False, TRIANGLES_RAD, False)
    for each in shapes_in(shape, TopAbs.TopAbs_FACE):
        yield _face(TopoDS.TopoDS.Face_s(each) if hasattr(TopoDS.TopoDS, "Face_s") else TopoDS.TopoDS.Face(each))


def _face(face: Any) -> BrepFace:
    location = TopLoc.TopLoc_Location()
    mesh = BRep.BRep_Tool.Triangulation_s(face, location)
    if mesh is None:
        return BrepFace("none", np.zeros(3), np.zeros(3), 0.0, 0.0, np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
    T = matrix_of(location.Transformation())
    nodes = np.array([_xyz(mesh.Node(i)) for i in range(1, mesh.NbNodes() + 1)])
    triangles = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)], dtype=np.int64) - 1
    triangles = triangles.reshape(-1, 3)
    if face.Orientation() == TopAbs.TopAbs_REVERSED:
        triangles = triangles[:, ::-1]
    return BrepFace(*_surface(face, mesh, triangles), nodes @ T[:3, :3].T + T[:3, 3], triangles)


def _surface(face: Any, mesh: Any, triangles: Any) -> tuple[str, Array, Array, float, float]:
    """Its kind and parameters."""
    surface = BRepAdaptor.BRepAdaptor_Surface(face)
    kind = str(surface.GetType()).rsplit("_", 1)[-1].lower()
    if kind in ("plane", "cylinder", "cone"):
        shape = getattr(surface, kind.capitalize())()
        radius = 0.0 if kind == "plane" else shape.Radius() if kind == "cylinder" else shape.RefRadius()
        slope = float(np.tan(shape.SemiAngle())) if kind == "cone" else 0.0
        return kind, _xyz(shape.Location()), _xyz(shape.Axis().Direction()), radius, slope
    if kind in ("sphere", "torus") or not mesh.HasUVNodes():
        return kind if kind in ("sphere", "torus") else "other", np.zeros(3), np.zeros(3), 0.0, 0.0
    return "free", *_samples(surface, mesh, triangles), 0.0, 0.0


def _samples(surface: Any, mesh: Any, triangles: Any) -> tuple[Array, Array]:
    """Points on a surface and its normals there: at corners and middles of triangles."""
    nodes = [mesh.UVNode(i) for i in range(1, mesh.NbNodes() + 1)]
    uv = np.array([(p.X(), p.Y()) for p in nodes])
    every = np.concatenate([uv, uv[triangles].mean(axis=1)])
    points = []
    normals = []
    for u, v in every[:: -(-len(every) // _MOST_SAMPLES)]:
        point = gp.gp_Pnt()
        along_u = gp.gp_Vec()
        along_v = gp.gp_Vec()
        surface.D1(float(u), float(v), point, along_u, along_v)
        n = np.cross(_xyz(along_u), _xyz(along_v))
        if np.linalg.norm(n) > 1e-12:
            points.append(_xyz(point))
            normals.append(n / np.linalg.norm(n))
    return np.array(points).reshape(-1, 3), np.array(normals).reshape(-1, 3)


def _xyz(each: Any) -> Array:
    return np.array([each.X(), each.Y(), each.Z()])


def write_solids(path: str) -> None:
    """Read a file with little memory and time, and write what it holds to the standard output, pickled.

    What the reader prints goes elsewhere.
    """
    out = os.dup(1)
    os.dup2(2, 1)
    limits = {resource.RLIMIT_AS: READER_BYTES, resource.RLIMIT_CPU: READER_S, resource.RLIMIT_CORE: 0}
    for what, most in limits.items():
        with suppress(OSError, ValueError):
            resource.setrlimit(what, (most, most))
    try:
        solids = pickle.dumps(solids_of(Path(path)))
    except (MemoryError, RuntimeError, ValueError, TypeError) as error:
        sys.exit(f"{type(error).__name__}: {error}")
    with os.fdopen(out, "wb") as file:
        file.write(solids)
