"""What stands beside a part file whose pieces are not boxes alone: its faces, its matter, where it comes from."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import WHOLE_TURN, Array, Face, RoundFace, flat_area, plane_across
from apo_bench.io import JsonNode, read_toml
from apo_bench.parts.allowed import FACE_OR_PART_NAME, FRICTION, LARGEST_PART_BYTES, LONGEST_FACE_NAME, MOST_FACES

PART_SCHEMA = "apo-bench/part/1"
USUAL_DENSITY = 1000.0
"""[kg/m^3], where none is stated."""
_LARGEST_MM = 10_000.0
_FLAT_MM = 1e-3
"""Corners of a face lie this near to its plane."""
_SMALLEST_MM2 = 1e-6
_THINNEST_RADIUS_MM = 0.05
_UNIT = 1e-6
KINDS = ("plane", "cylinder", "cone", "rim")


@final
@dataclass(frozen=True, eq=False)
class StatedPart:
    """What a `NAME.toml` says of the part in `NAME.xml`."""

    faces: Mapping[str, Face]
    rounds: Mapping[str, RoundFace]
    volume: float
    """[m^3]."""
    centroid: Array
    """(3,), [m]."""
    inertia: Array
    """Of density 1 about the centroid, (3, 3), [m^5]."""
    density: float
    """[kg/m^3]."""
    friction: tuple[float, ...]
    """Sliding, and then turning and rolling, as in MJCF; empty if unsaid."""
    source: str
    licence: str
    title: str
    """What a person calls the part; empty if unsaid."""


def read_stated_part(path: Path) -> StatedPart:
    """Read the file beside a part file.

    Raises:
        InputError: Anything in the file that is not as described, naming file and place.
    """
    top = read_toml(path, "file that states the faces of a part", LARGEST_PART_BYTES).fields_of(
        PART_SCHEMA,
        ("faces", "volume_mm3", "centroid_mm", "inertia_mm5"),
        ("title", "density", "friction", "source", "licence"),
    )
    faces = [_face(name, node) for name, node in _named(top["faces"])]
    return StatedPart(
        faces={face.name: face for face in faces if isinstance(face, Face)},
        rounds={face.name: face for face in faces if isinstance(face, RoundFace)},
        volume=1e-9 * top["volume_mm3"].number(0.0, 1e15, above=True),
        centroid=1e-3 * _within(top["centroid_mm"], 3),
        inertia=1e-15 * _inertia(top["inertia_mm5"]),
        density=top["density"].number(1.0, 25_000.0) if "density" in top else USUAL_DENSITY,
        friction=_friction(top["friction"]) if "friction" in top else (),
        source=top["source"].text() if "source" in top else "",
        licence=top["licence"].text() if "licence" in top else "",
        title=top["title"].text() if "title" in top else "",
    )


def _named(node: JsonNode) -> list[tuple[str, JsonNode]]:
    """The tables of faces, each with its name."""
    node.require(
        isinstance(node.value, dict) and node.value,
        "tables of faces are needed",
        'such as [faces.top] with kind = "plane"',
    )
    require(
        len(node.value) <= MOST_FACES,
        f"{node.file}: {len(node.value)} faces are stated; {MOST_FACES} are the most that a part has.",
    )
    for name in node.value:
        node.child(name, "a name").require(
            len(name) <= LONGEST_FACE_NAME and FACE_OR_PART_NAME.fullmatch(name),
            f"letters, digits and underscores after a letter, {LONGEST_FACE_NAME} in all at most, are needed",
        )
    return [(name, node.child(value, name)) for name, value in node.value.items()]


def _face(name: str, node: JsonNode) -> Face | RoundFace:
    kind = node.value.get("kind") if isinstance(node.value, dict) else None
    if kind == "plane":
        return _plane(name, node)
    if kind in KINDS:
        return _round(name, node, str(kind))
    at = node if not isinstance(node.value, dict) or "kind" not in node.value else node.child(kind, "kind")
    at.fail("kind = " + " or ".join(f'"{each}"' for each in KINDS) + " is needed")


def _plane(name: str, node: JsonNode) -> Face:
    keys = node.fields(("kind", "outline_mm"), ("holes_mm", "fit"))
    outline = _ring(keys["outline_mm"])
    holes = tuple(_ring(each) for each in keys["holes_mm"].items("hole")) if "holes_mm" in keys else ()
    across = twice_area(outline)
    keys["outline_mm"].require(np.linalg.norm(across) >= 2.0 * _SMALLEST_MM2, "corners around an area are needed")
    n = across / np.linalg.norm(across)
    for ring in (outline, *holes):
        node.require(
            np.abs((ring - outline[0]) @ n).max() <= _FLAT_MM, f"corners within {_FLAT_MM:g} mm of one plane are needed"
        )
    node.require(
        flat_area(outline, holes, plane_across(n)).is_valid,
        "an outline and holes inside it that do not cross are needed",
    )
    for i, hole in enumerate(holes, start=1):
        node.child(hole.tolist(), f"hole {i}").require(
            twice_area(hole) @ n < 0.0, "corners clockwise as seen from outside are needed"
        )
    return Face(name, 1e-3 * outline, tuple(1e-3 * hole for hole in holes), "fit" in keys and keys["fit"].flag())


def twice_area(ring: Array) -> Array:
    """Twice the area of a ring as a vector along its normal, (3,)."""
    corners = ring - ring[0]
    return np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)


def _ring(node: JsonNode) -> Array:
    corners = node.items("corner")
    node.require(len(corners) >= 3, "three corners or more are needed")
    return np.array([_within(corner, 3) for corner in corners])


def _round(name: str, node: JsonNode, kind: str) -> RoundFace:
    sizes = {"cylinder": ("radius_mm", "span_mm"), "cone": ("radii_mm", "span_mm"), "rim": ("radius_mm",)}[kind]
    around = () if kind == "rim" else ("fit", "extent_deg", "toward")
    keys = node.fields(("kind", "at_mm", "axis", *sizes, "hole"), around)
    if "radius_mm" in keys:
        radii = [keys["radius_mm"].number(_THINNEST_RADIUS_MM, _LARGEST_MM)] * 2
    else:
        radii = [each.number(0.0, _LARGEST_MM) for each in keys["radii_mm"].items("radius", 2)]
        keys["radii_mm"].require(
            abs(radii[1] - radii[0]) >= 1e-3, 'two radii that differ are needed, else kind = "cylinder"'
        )
    span = _within(keys["span_mm"], 2) if "span_mm" in keys else np.zeros(2)
    keys.get("span_mm", node).require(
        kind == "rim" or span[1] - span[0] >= 1e-3, "a start and an end that is greater are needed"
    )
    axis = _unit(keys["axis"])
    extent = np.radians(keys["extent_deg"].number(0.0, 360.0, above=True)) if "extent_deg" in keys else WHOLE_TURN
    node.require(
        (extent < WHOLE_TURN - 1e-9) == ("toward" in keys),
        "extent_deg below 360 and toward are needed together, or none of them",
    )
    return RoundFace(
        name=name,
        point=1e-3 * _within(keys["at_mm"], 3),
        axis=axis,
        span=(1e-3 * float(span[0]), 1e-3 * float(span[1])),
        radii=(1e-3 * radii[0], 1e-3 * radii[1]),
        hole=keys["hole"].flag(),
        fit="fit" in keys and keys["fit"].flag(),
        extent_rad=float(extent),
        toward=_beside(keys["toward"], axis) if "toward" in keys else None,
    )


def _unit(node: JsonNode) -> Array:
    v = node.numbers(3)
    length = float(np.linalg.norm(v))
    node.require(_UNIT < length < 1.0 / _UNIT, "a direction, three numbers that are not all 0, is needed")
    return np.asarray(v / length)


def _beside(node: JsonNode, axis: Array) -> Array:
    """A unit vector across the axis."""
    v = _unit(node)
    node.require(abs(v @ axis) <= 1e-3, "a direction across the axis is needed")
    v = v - (v @ axis) * axis
    return np.asarray(v / np.linalg.norm(v))


def _within(node: JsonNode, count: int) -> Array:
    lengths = node.numbers(count)
    node.require(
        np.abs(lengths).max() <= _LARGEST_MM, f"{count} numbers of {-_LARGEST_MM:g} to {_LARGEST_MM:g} are needed"
    )
    return lengths


def _inertia(node: JsonNode) -> Array:
    """xx, yy, zz, xy, xz, yz as a matrix."""
    xx, yy, zz, xy, xz, yz = node.numbers(6)
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    node.require(
        np.abs(J).max() < 1e30 and np.linalg.eigvalsh(J)[0] > 0.0, "xx, yy, zz, xy, xz, yz of a solid are needed"
    )
    return J


def _friction(node: JsonNode) -> tuple[float, ...]:
    values = node.value if isinstance(node.value, list) else [node.value]
    numbers = node.child(values, "numbers").numbers(len(values)) if 1 <= len(values) <= 3 else None
    if numbers is None or not all(low <= x <= high for x, (low, high) in zip(numbers, FRICTION.spans, strict=False)):
        node.fail(f"{FRICTION.words} are needed")
    return tuple(float(x) for x in numbers)
