"""Turn a body into a solid with named pieces and faces, and write it as a part file."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import WHOLE_TURN, Array, Box, Face, Hull, Piece, RoundFace, Solid, all_boxes, make_flat_area
from apo_bench.io import format_toml, write_file
from apo_bench.scenario.parts.limits import THINNEST_M, is_name
from apo_bench.scenario.parts.making.body import Body
from apo_bench.scenario.parts.stated_properties import PART_SCHEMA

_ALIGNED = 1e-9
"""Tolerance within which directions and corners agree with the axes of the frame."""
_STEEL = (0.70, 0.72, 0.75)
"""Default colour: red, green, blue."""


def build_solid(name: str, body: Body) -> Solid:
    """Make the solid of a body; pieces become `p1`, `p2`, ..., unnamed faces `auto_px_1`, `auto_flat_1`, `auto_bore_1`.

    Raises:
        ValueError: Two faces have the same name.
    """
    named = [face.name for faces in (body.flats, body.rounds) for face in faces if face.name]
    if len(set(named)) < len(named):
        raise ValueError(f"part '{name}' has faces with one name; each needs its own: {', '.join(sorted(named))}")
    flats = _name_faces(sorted(body.flats, key=_name_by_position))
    rounds = _name_faces(body.rounds)
    return Solid(
        name=name,
        faces={face.name: face for face in flats},
        pieces=tuple(_name_piece(f"p{i}", piece) for i, piece in enumerate(body.pieces, start=1)),
        centroid=body.moments.centroid,
        volume=body.moments.size,
        rounds={face.name: face for face in rounds},
        inertia=body.moments.inertia,
    )


_Some = TypeVar("_Some", Face, RoundFace)


def _name_faces(faces: Iterable[_Some]) -> list[_Some]:
    """Name the faces without a name `auto_KIND_NUMBER`, numbered among all faces of their kind; these come last."""
    counts: dict[str, int] = {}
    named = []
    for face in faces:
        stem = _name_stem(face)
        counts[stem] = counts.get(stem, 0) + 1
        named.append(face if face.name else replace(face, name=f"auto_{stem}_{counts[stem]}"))
    return sorted(named, key=lambda face: face.name.startswith("auto_"))


def _name_by_position(face: Face) -> tuple[float, ...]:
    """Sort key of a flat face: its height along its main axis, then its lowest coordinates along the next axes."""
    axis = int(np.abs(face.normal).argmax())
    low = face.outline.min(axis=0)
    return tuple(round(float(low[i % 3]), 9) for i in (axis, axis + 1, axis + 2))


def _name_stem(face: Face | RoundFace) -> str:
    """The kind of a face in automatic names, such as `bore`, `flat`, or `px` for a face that looks along +x."""
    if isinstance(face, RoundFace):
        return {"cylinder": "bore" if face.hole else "shaft", "cone": "cone", "rim": "rim"}[face.kind]
    axis = int(np.abs(face.normal).argmax())
    if abs(face.normal[axis]) < 1.0 - _ALIGNED:
        return "flat"
    return ("p" if face.normal[axis] > 0.0 else "n") + "xyz"[axis]


def _name_piece(name: str, hull: Hull) -> Piece:
    """The named piece, as a `Box` if the hull is an axis-aligned box."""
    if hull.cylinder is None and len(hull.corners) == 8 and hull.half.min() >= THINNEST_M:
        box = Box(name, hull.center, hull.half)
        if np.abs(hull.corners[:, None] - box.corners[None]).max(axis=2).min(axis=0).max() < _ALIGNED:
            return box
    return replace(hull, name=name)


def write_part(
    name: str,
    body: Body,
    folder: Path,
    *,
    density: float = 1000.0,
    friction: Sequence[float] = (0.8, 0.005, 0.0001),
    color: tuple[float, float, float] = _STEEL,
    source: str,
    licence: str,
    title: str = "",
    by_sites: bool = True,
) -> Path:
    """Write `NAME.xml` and, unless sites suffice, `NAME.toml`, so that `load_part` returns the same solid.

    Args:
        density: [kg/m^3].
        friction: Sliding, torsional, rolling, as in MJCF.
        color: Red, green, blue, 0 to 1.
        source: Origin of the shape.
        title: Name for people, in any letters.
        by_sites: Whether sites name the faces if all pieces are boxes.

    Returns:
        The path of `NAME.xml`.
    """
    require(is_name(name), f"the name '{name}' of a part must be a letter, then letters, digits and underscores.")
    require(density > 0.0, f"a density of {density:g} kg/m^3 was given; a number above 0 is allowed.")
    solid = build_solid(name, body)
    path = folder / f"{name}.xml"
    boxes = by_sites and all_boxes(solid.pieces)
    matter = {"density": f"{density:g}", "friction": _join_numbers(friction)} if boxes else {}
    root = _build_tree(solid, boxes, {**matter, "rgba": _join_numbers((*color, 1.0))})
    origin = "; ".join(filter(None, (title, source, licence))).replace("--", "- -")  # which would end the comment
    note = f"<!-- {origin} -->\n" if boxes else ""
    indent(root)
    write_file(path, note + tostring(root, encoding="unicode") + "\n")
    if not boxes:
        write_file(
            path.with_suffix(".toml"), format_stated_properties(solid, density, friction, source, licence, title)
        )
    return path


def _build_tree(solid: Solid, by_sites: bool, attributes: dict[str, Any]) -> Element:
    """The MJCF document of a part.

    Args:
        by_sites: Whether sites name the faces; else the TOML file has them.
        attributes: Those of the default geom.
    """
    root = Element("mujoco", model=solid.name)
    default = SubElement(root, "default")
    SubElement(default, "geom", type="box" if all_boxes(solid.pieces) else "mesh", **attributes)
    meshes = [p for p in solid.pieces if isinstance(p, Hull) and p.cylinder is None]
    if by_sites:
        SubElement(default, "site", size="0.0015", group="4")
        SubElement(SubElement(default, "default", {"class": "fit"}), "site", size="0.002", group="4")
    if meshes:
        asset = SubElement(root, "asset")
        for mesh in meshes:
            SubElement(asset, "mesh", name=mesh.name, vertex=_join_numbers(mesh.corners.ravel()))
    body = SubElement(SubElement(root, "worldbody"), "body", name=solid.name)
    for piece in solid.pieces:
        SubElement(body, "geom", name=piece.name, **_write_geom(piece))
    if by_sites:
        for face in solid.faces.values():
            fit = {"class": "fit"} if face.fit else {}
            if not face.name.startswith("auto_"):
                SubElement(body, "site", {"name": face.name, **fit, "pos": _join_numbers(_find_point_inside(face))})
    return root


def _write_geom(piece: Piece) -> dict[str, Any]:
    """The attributes of the geom of a piece."""
    if isinstance(piece, Box):
        return {"type": "box", "pos": _join_numbers(piece.center), "size": _join_numbers(piece.half)}
    if piece.cylinder is None:
        return {"type": "mesh", "mesh": piece.name}
    center, axis, radius, half = piece.cylinder
    return {
        "type": "cylinder",
        "pos": _join_numbers(center),
        "zaxis": _join_numbers(axis),
        "size": _join_numbers((radius, half)),
    }


def _find_point_inside(face: Face) -> Array:
    """A point (3,) inside an axis-aligned face, away from its edges, [m]."""
    axis = int(np.abs(face.normal).argmax())
    plane = [(axis + 1) % 3, (axis + 2) % 3]
    point = make_flat_area(face.outline, face.holes, np.eye(3)[:, plane]).representative_point()
    inside = np.array(face.outline[0])
    inside[plane] = point.x, point.y
    return inside


def format_stated_properties(
    solid: Solid, density: float, friction: Sequence[float], source: str, licence: str, title: str = ""
) -> str:
    """Return the text of `NAME.toml`: faces, volume, centroid, inertia and material of a part."""
    assert solid.inertia is not None
    # xx, yy, zz, xy, xz, yz
    six = 1e15 * solid.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    document = {
        "schema": PART_SCHEMA,
        "title": title,
        "source": source,
        "licence": licence,
        "density": float(density),
        "friction": list(map(float, friction)),
        "volume_mm3": float(f"{1e9 * solid.volume:.12g}"),
        "centroid_mm": _write_list(1e3 * solid.centroid),
        "inertia_mm5": [float(f"{x:.12g}") for x in six],
        "faces": {face.name: _plane_table(face) for face in solid.faces.values()}
        | {wall.name: _round_table(wall) for wall in solid.rounds.values()},
    }
    return format_toml(document)


def _plane_table(face: Face) -> dict[str, Any]:
    """The entry of a flat face in the TOML file."""
    table = {"kind": "plane", "outline_mm": _write_list(1e3 * face.outline)}
    holes = {"holes_mm": [_write_list(1e3 * hole) for hole in face.holes]} if face.holes else {}
    return table | holes | {"fit": face.fit}


def _round_table(wall: RoundFace) -> dict[str, Any]:
    """The entry of a round face in the TOML file."""
    table: dict[str, Any] = {
        "kind": wall.kind,
        "at_mm": _write_list(1e3 * wall.point),
        "axis": _write_list(wall.axis, 12),
    }
    table["hole"] = wall.hole
    if wall.kind == "cone":
        table["radii_mm"] = _write_list(1e3 * np.array(wall.radii))
    else:
        table["radius_mm"] = round(1e3 * wall.radius, 9)
    if wall.kind != "rim":
        table |= {"span_mm": _write_list(1e3 * np.array(wall.span)), "fit": wall.fit}
    if wall.toward is not None and wall.extent_rad < WHOLE_TURN:
        table |= {"extent_deg": round(float(np.degrees(wall.extent_rad)), 9), "toward": _write_list(wall.toward, 12)}
    return table


def _write_list(values: Array, digits: int = 9) -> Any:
    """Return rounded numbers as nested lists; adding 0.0 turns -0.0 into 0.0."""
    return np.vectorize(lambda x: round(float(x), digits) + 0.0, otypes=[float])(values).tolist()


def _join_numbers(values: Iterable[float]) -> str:
    """Numbers as the text of an XML attribute."""
    return " ".join(_write_number(x, 12) for x in values)


def _write_number(x: float, digits: int) -> str:
    text = f"{x:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text
