"""The tree of a STEP file: shapes with the names of product and instance, where they are, and their colours."""

import re
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from OCP import TDF, IFSelect, Quantity, STEPCAFControl, TCollection, TDataStd, TDocStd, TopAbs, TopExp, TopLoc, XCAFDoc
from OCP import collections as sequences

from apo_bench.cad.solids.raw_solid import Rgb
from apo_bench.geometry import Array

_NO_NAME = re.compile(
    r"|=>\[.*|NAUO\d*|\d+|SOLID|SHELL|COMPOUND|Next assembly (usage|relationship)|Open CASCADE STEP translator.*",
    re.IGNORECASE,
)
"""What programs write where a person gave no name."""


class Leaf(NamedTuple):
    """A shape of the file at one of its places."""

    product: str
    """What the file calls the part."""
    name: str
    """... and this copy of it; as the product, where it has no name of its own."""
    shape: Any
    """In its own frame."""
    T: Array
    """(4, 4), [mm]."""
    color: Rgb | None


def leaves_of(path: Path) -> Iterator[Leaf]:
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


def _below(label: Any, T: Array, product: str, name: str, colors: Any) -> Iterator[Leaf]:
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
    here = T @ matrix_of(XCAFDoc.XCAFDoc_ShapeTool.GetLocation_s(label).Transformation())
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
    yield Leaf(product, name, shape, here @ matrix_of(placed.Location().Transformation()), color)


def _name(label: Any) -> str:
    """As a person gave it, or empty."""
    attribute = TDataStd.TDataStd_Name()
    if not label.FindAttribute(TDataStd.TDataStd_Name.GetID_s(), attribute):
        return ""
    text = "".join(c if c.isprintable() else " " for c in attribute.Get().ToExtString()).strip()
    return "" if _NO_NAME.fullmatch(text) else text


def matrix_of(transformation: Any) -> Array:
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
    of_faces = (_first_color(colors.GetColor, face) for face in shapes_in(shape, TopAbs.TopAbs_FACE))
    counts = Counter(color for color in of_faces if color)
    return _first_color(colors.GetColor, shape) or max(counts, key=lambda color: counts[color], default=None)


def shapes_in(shape: Any, kind: Any, outside: Any = None) -> Iterator[Any]:
    """Of one kind, those inside of another kind left out."""
    explorer = TopExp.TopExp_Explorer(shape, kind, *([] if outside is None else [outside]))
    while explorer.More():
        yield explorer.Current()
        explorer.Next()
