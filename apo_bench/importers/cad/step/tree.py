"""Read the assembly tree of a STEP file by Open CASCADE: shapes with names, places and colours."""

import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from OCP import TDF, IFSelect, Quantity, STEPCAFControl, TCollection, TDataStd, TDocStd, TopLoc, XCAFDoc
from OCP import collections as sequences

from apo_bench.geometry import Array
from apo_bench.importers.cad.solids import Rgb, SolidPlace

_NO_NAME = re.compile(
    r"|=>\[.*|NAUO\d*|\d+|SOLID|SHELL|COMPOUND|Next assembly (usage|relationship)|Open CASCADE STEP translator.*",
    re.IGNORECASE,
)
"""Names that programs write if the user gave none."""
_Leaf = tuple[str, Any, SolidPlace]
"""Name of a part, its shape in its own frame, and one of its places, whose name may be that of the part."""


def read_leaves(path: Path) -> Iterator[_Leaf]:
    """Yield the shapes that are no assemblies, in the order of the file.

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
        yield from _leaves_below(root, np.eye(4), path.stem, path.stem, colors)


def _leaves_below(label: Any, T: Array, product: str, name: str, colors: Any) -> Iterator[_Leaf]:
    """Yield the leaves below one entry of the tree.

    Args:
        label: The entry of the tree.
        colors: The colour tool of the document.
        T: (4, 4), pose of the entry's parent in the file, [mm].
        product, name: Names of the parent's part and place, for entries without a name.
    """
    part = label  # the entry that a reference stands for
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
            yield from _leaves_below(each, here, product, name, colors)
        return
    # Keep the shape in its own frame, so that all copies share one shape, and put its location into the place.
    placed = XCAFDoc.XCAFDoc_ShapeTool.GetShape_s(part)
    shape = placed.Located(TopLoc.TopLoc_Location())
    of_label = XCAFDoc.XCAFDoc_ColorTool.GetColor_s
    color = _color(of_label, label) or _color(of_label, part) or _color(colors.GetColor, shape)
    yield product, shape, SolidPlace(name, here @ matrix_of(placed.Location().Transformation()), color)


def _name(label: Any) -> str:
    """Return the name that the user gave, or an empty text."""
    attribute = TDataStd.TDataStd_Name()
    if not label.FindAttribute(TDataStd.TDataStd_Name.GetID_s(), attribute):
        return ""
    text = attribute.Get().ToExtString()
    with suppress(UnicodeError):  # some programs write UTF-8, which Open CASCADE reads byte by byte
        text = text.encode("latin-1").decode("utf-8")
    text = "".join(c if c.isprintable() else " " for c in text).strip()
    return "" if _NO_NAME.fullmatch(text) else text


def _color(get: Callable[[Any, Any, Any], bool], owner: Any) -> Rgb | None:
    """Return the surface colour of an entry of the tree or a shape, else its general colour; None without one.

    Args:
        get: Function that reads a colour of the owner, by kind, into a colour object; False if there is none.
    """
    color = Quantity.Quantity_Color()
    if not any(get(owner, kind, color) for kind in (XCAFDoc.XCAFDoc_ColorSurf, XCAFDoc.XCAFDoc_ColorGen)):
        return None
    r, g, b = np.clip(color.Values(Quantity.Quantity_TOC_sRGB), 0.0, 1.0).tolist()
    return r, g, b


def matrix_of(transformation: Any) -> Array:
    """Return a transformation of Open CASCADE as a matrix, (4, 4), [mm]."""
    rows = [[transformation.Value(i, k) for k in range(1, 5)] for i in range(1, 4)]
    return np.array([*rows, [0.0, 0.0, 0.0, 1.0]])
