"""Read the solids of a STEP file as B-rep faces: surfaces, and triangles by Open CASCADE, [mm]."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from OCP import Bnd, BRep, BRepAdaptor, BRepBndLib, BRepMesh, ShapeAnalysis, TopAbs, TopExp, TopLoc, TopoDS, gp

from apo_bench.geometry import Array
from apo_bench.importers.cad.faces.surface_fitting import RoundSurface
from apo_bench.importers.cad.solids import SolidPlace
from apo_bench.importers.cad.step.surfaces import BrepFace, BrepSolid, Plane
from apo_bench.importers.cad.step.tree import matrix_of, read_leaves

_TRIANGLES_RAD = 0.2
"""Angle between neighbouring triangles on round walls, the same for all walls around one axis."""
_SAGITTA = 1e-2
"""Largest distance of triangles from the surface, as a share of the size of the solid."""
_SPLINE_MM = 5e-4
"""A spline within this distance of a plane, a cylinder or a cone is taken as such."""


def read_solids(path: Path) -> list[BrepSolid]:
    """Read a STEP file: each solid once with all of its places, in the order of the file, named like its component.

    Raises:
        ValueError: The file cannot be read.
    """
    shapes: dict[Any, tuple[str, Any, list[SolidPlace]]] = {}
    for product, shape, place in read_leaves(path):
        # Copies share their TShape, so each shape is read once.
        shapes.setdefault(shape.TShape(), (product, shape, []))[2].append(place)
    return [
        BrepSolid(name, faces, (*places,), i)
        for i, (name, shape, places) in enumerate(shapes.values())
        for faces in _solids(shape)
    ]


def _solids(shape: Any) -> Iterator[tuple[BrepFace, ...]]:
    """Yield the faces of each solid in a shape, and of its shells that belong to no solid."""
    every = [*_shapes_in(shape, TopAbs.TopAbs_SOLID), *_shapes_in(shape, TopAbs.TopAbs_SHELL, TopAbs.TopAbs_SOLID)]
    if not every and any(_shapes_in(shape, TopAbs.TopAbs_FACE)):
        every = [shape]
    for each in every:
        box = Bnd.Bnd_Box()
        BRepBndLib.BRepBndLib.Add_s(each, box, False)
        size = 1.0 if box.IsVoid() else float(np.sqrt(box.SquareExtent()))
        BRepMesh.BRepMesh_IncrementalMesh(each, _SAGITTA * size, False, _TRIANGLES_RAD, False)
        yield tuple(_face(TopoDS.TopoDS.Face(face)) for face in _shapes_in(each, TopAbs.TopAbs_FACE))


def _shapes_in(shape: Any, *kinds: Any) -> Iterator[Any]:
    """Yield the shapes of the first kind, except those inside shapes of the second kind."""
    explorer = TopExp.TopExp_Explorer(shape, *kinds)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


def _face(face: Any) -> BrepFace:
    """Return a face with its surface and triangles; no triangles if Open CASCADE could not triangulate it."""
    location = TopLoc.TopLoc_Location()
    mesh = BRep.BRep_Tool.Triangulation_s(face, location)
    if mesh is None:
        return BrepFace(None, 0.0, np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
    T = matrix_of(location.Transformation())
    corners = np.array([_xyz(mesh.Node(i)) for i in range(1, mesh.NbNodes() + 1)]) @ T[:3, :3].T + T[:3, 3]
    triangles = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)], dtype=np.int64) - 1
    triangles = triangles.reshape(-1, 3)
    if face.Orientation() == TopAbs.TopAbs_REVERSED:
        triangles = triangles[:, ::-1]
    shape, residual = _elementary(face)
    surface: Plane | RoundSurface | None = None
    if shape is not None:
        at, along = _xyz(shape.Location()), _xyz(shape.Axis().Direction())
        surface = Plane(at, along)
        if isinstance(shape, gp.gp_Cylinder):
            surface = RoundSurface(at, along, shape.Radius(), 0.0)
        elif isinstance(shape, gp.gp_Cone):
            surface = RoundSurface(at, along, shape.RefRadius(), float(np.tan(shape.SemiAngle())))
    return BrepFace(surface, residual, corners, triangles)


def _elementary(face: Any) -> tuple[Any, float]:
    """Return the plane, cylinder or cone of a face by Open CASCADE, or None, and the deviation of a spline from it."""
    surface = BRepAdaptor.BRepAdaptor_Surface(face)
    kind = str(surface.GetType()).rsplit("_", 1)[-1]
    if kind in ("Plane", "Cylinder", "Cone"):
        return getattr(surface, kind)(), 0.0
    found = ShapeAnalysis.ShapeAnalysis_CanonicalRecognition(face)
    for is_such, shape in (
        (found.IsPlane, gp.gp_Pln()),
        (found.IsCylinder, gp.gp_Cylinder()),
        (found.IsCone, gp.gp_Cone()),
    ):
        if is_such(_SPLINE_MM, shape):
            return shape, found.GetGap()
    return None, 0.0


def _xyz(each: Any) -> Array:
    return np.array([each.X(), each.Y(), each.Z()])
