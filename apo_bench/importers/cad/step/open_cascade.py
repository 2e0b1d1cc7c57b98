"""Solids of a STEP file as Open CASCADE reads them: names, places, colours, faces."""

import re
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from OCP import (
    TDF,
    Bnd,
    BRep,
    BRepAdaptor,
    BRepBndLib,
    BRepMesh,
    IFSelect,
    Quantity,
    ShapeAnalysis,
    STEPCAFControl,
    TCollection,
    TDataStd,
    TDocStd,
    TopAbs,
    TopExp,
    TopLoc,
    TopoDS,
    XCAFDoc,
    gp,
)
from OCP import collections as sequences

from apo_bench.geometry import Array
from apo_bench.importers.cad.faces.fitting import Round
from apo_bench.importers.cad.solids.raw_solid import Rgb, SolidPlace
from apo_bench.importers.cad.step.surfaces import BrepFace, BrepSolid, Flat, Wall

_NO_NAME = re.compile(
    r"|=>\[.*|NAUO\d*|\d+|SOLID|SHELL|COMPOUND|Next assembly (usage|relationship)|Open CASCADE STEP translator.*",
    re.IGNORECASE,
)
"""What programs write where a person gave no name."""
_Leaf = tuple[str, Any, SolidPlace]
"""What the file calls a part, its shape in its own frame, and one of its places; a copy without a name is called so."""


def _leaves_of(path: Path) -> Iterator[_Leaf]:
    """Shapes that are no assemblies, in the order of the file.

    Raises:
        ValueError: The file cannot be read.
    """
    document = TDocStd.TDocStd_Document(TCollection.TCollection_ExtendedString("XCAF"))
    reader = STEPCAFControl.STEPCAFControl_Reader()
    reader.SetNameMode(True)
    reader.SetColorMode(True)
    if reader.ReadFile(str(path)) != IFSelect.IFSelect_RetDone or not reader.Transfer(document):
        raise ValueError("no STEP file")
    roots = sequences.Sequence_TDF_Label()
    XCAFDoc.XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).GetFreeShapes(roots)
    colors = XCAFDoc.XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    for root in roots:
        yield from _below(root, np.eye(4), path.stem, path.stem, colors)


def _below(label: Any, T: Array, product: str, name: str, colors: Any) -> Iterator[_Leaf]:
    """The leaves of one entry of the tree.

    Args:
        product, name: Of what it is in, for those that have none.
    """
    part = label
    if XCAFDoc.XCAFDoc_ShapeTool.IsReference_s(label):
        part = TDF.TDF_Label()
        XCAFDoc.XCAFDoc_ShapeTool.GetReferredShape_s(label, part)
    own_name = _name(part)
    product = own_name or product
    name = _name(label) or own_name or name
    here = T @ _matrix_of(XCAFDoc.XCAFDoc_ShapeTool.GetLocation_s(label).Transformation())
    if XCAFDoc.XCAFDoc_ShapeTool.IsAssembly_s(part):
        inside = sequences.Sequence_TDF_Label()
        XCAFDoc.XCAFDoc_ShapeTool.GetComponents_s(part, inside)
        for each in inside:
            yield from _below(each, here, product, name, colors)
        return
    # A shape in its own frame, so that all of its copies are one shape, and where that frame is.
    placed = XCAFDoc.XCAFDoc_ShapeTool.GetShape_s(part)
    shape = placed.Located(TopLoc.TopLoc_Location())
    of_label = XCAFDoc.XCAFDoc_ColorTool.GetColor_s
    color = _first_color(of_label, label) or _first_color(of_label, part) or _color_of_faces(colors, shape)
    yield product, shape, SolidPlace(name, here @ _matrix_of(placed.Location().Transformation()), color)


def _name(label: Any) -> str:
    """As a person gave it, or empty."""
    attribute = TDataStd.TDataStd_Name()
    if not label.FindAttribute(TDataStd.TDataStd_Name.GetID_s(), attribute):
        return ""
    text = attribute.Get().ToExtString()
    with suppress(UnicodeError):  # the letters of a UTF-8 file are read, and by some programs written, byte by byte
        text = text.encode("latin-1").decode("utf-8")
    text = "".join(c if c.isprintable() else " " for c in text).strip()
    return "" if _NO_NAME.fullmatch(text) else text


def _matrix_of(transformation: Any) -> Array:
    """(4, 4), [mm]."""
    rows = [[transformation.Value(i, k) for k in range(1, 5)] for i in range(1, 4)]
    return np.array([*rows, [0.0, 0.0, 0.0, 1.0]])


def _first_color(get: Callable[[Any, Any, Any], bool], owner: Any) -> Rgb | None:
    """The colour of a surface, else that of all of it; of an entry of the tree, or a shape."""
    color = Quantity.Quantity_Color()
    if not any(get(owner, kind, color) for kind in (XCAFDoc.XCAFDoc_ColorSurf, XCAFDoc.XCAFDoc_ColorGen)):
        return None
    r, g, b = np.clip(color.Values(Quantity.Quantity_TOC_sRGB), 0.0, 1.0).tolist()
    return r, g, b


def _color_of_faces(colors: Any, shape: Any) -> Rgb | None:
    """Of a shape, or what most of its coloured faces have, where it has none itself."""
    of_faces = (_first_color(colors.GetColor, face) for face in _shapes_in(shape, TopAbs.TopAbs_FACE))
    counts = Counter(color for color in of_faces if color)
    return _first_color(colors.GetColor, shape) or max(counts, key=lambda color: counts[color], default=None)


def _shapes_in(shape: Any, kind: Any, outside: Any = None) -> Iterator[Any]:
    """Of one kind, those inside of another kind left out."""
    explorer = TopExp.TopExp_Explorer(shape, kind, *([] if outside is None else [outside]))
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


_TRIANGLES_RAD = 0.2
"""The angle between neighbours on round walls, the same on walls around one axis."""
_SAGITTA = 1e-2
"""Distance of triangles from the surface at most, as part of the size of the solid."""
_SPLINE_MM = 5e-4
"""A spline this near to a plane, a cylinder or a cone is one."""


def solids_of(path: Path) -> list[BrepSolid]:
    """What a STEP file holds, each solid once with all of its places, in the order of the file."""
    shapes: dict[Any, tuple[str, Any, list[SolidPlace]]] = {}
    for product, shape, place in _leaves_of(path):
        shapes.setdefault(shape.TShape(), (product, shape, []))[2].append(place)
    return [solid for name, shape, places in shapes.values() for solid in _solids(name, shape, (*places,))]


def _solids(name: str, shape: Any, places: tuple[SolidPlace, ...]) -> Iterator[BrepSolid]:
    """The solids in a shape, and its shells that belong to none."""
    every = [*_shapes_in(shape, TopAbs.TopAbs_SOLID), *_shapes_in(shape, TopAbs.TopAbs_SHELL, TopAbs.TopAbs_SOLID)]
    if not every and any(_shapes_in(shape, TopAbs.TopAbs_FACE)):
        every = [shape]
    for i, each in enumerate(every, start=1):
        own_name = name if len(every) == 1 else f"{name}_{i}"
        yield BrepSolid(own_name, tuple(_faces(each)), places)


def _faces(shape: Any) -> Iterator[BrepFace]:
    box = Bnd.Bnd_Box()
    BRepBndLib.BRepBndLib.Add_s(shape, box, False)
    size = float(np.sqrt(box.SquareExtent())) if not box.IsVoid() else 1.0
    BRepMesh.BRepMesh_IncrementalMesh(shape, _SAGITTA * size, False, _TRIANGLES_RAD, False)
    for each in _shapes_in(shape, TopAbs.TopAbs_FACE):
        yield _face(TopoDS.TopoDS.Face(each))


def _face(face: Any) -> BrepFace:
    location = TopLoc.TopLoc_Location()
    mesh = BRep.BRep_Tool.Triangulation_s(face, location)
    if mesh is None:
        return BrepFace(None, np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
    T = _matrix_of(location.Transformation())
    nodes = np.array([_xyz(mesh.Node(i)) for i in range(1, mesh.NbNodes() + 1)])
    triangles = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)], dtype=np.int64) - 1
    triangles = triangles.reshape(-1, 3)
    if face.Orientation() == TopAbs.TopAbs_REVERSED:
        triangles = triangles[:, ::-1]
    return BrepFace(_surface_of(face), nodes @ T[:3, :3].T + T[:3, 3], triangles)


def _surface_of(face: Any) -> Flat | Wall | None:
    """As the file has it; what is stored as a spline, as the plane, cylinder or cone that it is."""
    shape, residual = _elementary(face)
    if shape is None:
        return None
    at, along = _xyz(shape.Location()), _xyz(shape.Axis().Direction())
    if isinstance(shape, gp.gp_Pln):
        return Flat(at, along, residual)
    if isinstance(shape, gp.gp_Cylinder):
        return Wall(Round(at, along, shape.Radius(), 0.0), residual)
    return Wall(Round(at, along, shape.RefRadius(), float(np.tan(shape.SemiAngle()))), residual)


def _elementary(face: Any) -> tuple[Any, float]:
    """The plane, cylinder or cone of a face and how far it is from that at most; None if it is on none."""
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
