"""Read the TOML file next to a part file, which states faces, volume, centroid, inertia and material."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, final

import numpy as np
from msgspec import Meta

from apo_bench.errors import require
from apo_bench.geometry import WHOLE_TURN, Array, Face, RoundFace, find_plane_across, make_flat_area
from apo_bench.io import FileTable, Finite, Positive, Text, Triple, convert_typed, read_typed
from apo_bench.scenario.parts.limits import DENSITY, LARGEST_PART_BYTES, MOST_FACES, is_name

PART_SCHEMA = "apo-bench/part/1"
USUAL_DENSITY = 1000.0
"""Default density, [kg/m^3]."""
_LARGEST_MM = 10_000.0
"""Largest absolute coordinate."""
_FLAT_MM = 1e-3
"""Largest distance of the corners of a face from its plane."""
_SMALLEST_MM2 = 1e-6
"""Least area of a flat face."""
_THINNEST_RADIUS_MM = 0.05
"""Least radius of a cylinder or a rim."""
_SHORTEST_MM = 1e-3
"""Least length of a wall, and least difference of the radii of a cone."""
_UNIT = 1e-6
"""Least length of a direction; its inverse is the largest."""
_Length = Annotated[float, Meta(ge=-_LARGEST_MM, le=_LARGEST_MM)]
_Point = tuple[_Length, _Length, _Length]
_Radius = Annotated[float, Meta(ge=_THINNEST_RADIUS_MM, le=_LARGEST_MM)]
_EndRadius = Annotated[float, Meta(ge=0.0, le=_LARGEST_MM)]
_Friction = Annotated[float, Meta(ge=0.0, le=10.0)]
_Ring = Annotated[list[_Point], Meta(min_length=3)]


class PlaneTable(FileTable, frozen=True, kw_only=True, tag_field="kind", tag="plane"):
    """A flat face."""

    outline_mm: _Ring
    holes_mm: tuple[_Ring, ...] = ()
    fit: bool = False


class RimTable(FileTable, frozen=True, kw_only=True, tag_field="kind", tag="rim"):
    """The circle at the end of a hole or a shaft."""

    at_mm: _Point
    axis: Triple
    hole: bool
    radius_mm: _Radius


class WallTable(FileTable, frozen=True, kw_only=True):
    """A round wall."""

    at_mm: _Point
    axis: Triple
    hole: bool
    span_mm: tuple[_Length, _Length]
    fit: bool = False
    extent_deg: Annotated[float, Meta(gt=0.0, le=360.0)] | None = None
    toward: Triple | None = None


class CylinderTable(WallTable, frozen=True, kw_only=True, tag_field="kind", tag="cylinder"):
    """A round wall of one radius."""

    radius_mm: _Radius


class ConeTable(WallTable, frozen=True, kw_only=True, tag_field="kind", tag="cone"):
    """A round wall whose radius changes along its span."""

    radii_mm: tuple[_EndRadius, _EndRadius]


FaceTable = PlaneTable | CylinderTable | ConeTable | RimTable


class MatterTable(FileTable, frozen=True, kw_only=True):
    """All entries of the file."""

    schema: Literal["apo-bench/part/1"]
    faces: Annotated[dict[str, Any], Meta(min_length=1, max_length=MOST_FACES)]
    volume_mm3: Positive
    centroid_mm: _Point
    inertia_mm5: tuple[Finite, Finite, Finite, Finite, Finite, Finite]
    title: Text = ""
    density: Annotated[float, Meta(ge=DENSITY[0], le=DENSITY[1])] = USUAL_DENSITY
    friction: _Friction | Annotated[tuple[_Friction, ...], Meta(max_length=3)] = ()
    source: Text = ""
    licence: Text = ""


@final
@dataclass(frozen=True, eq=False)
class StatedPart:
    """The content of `NAME.toml`, next to the part file `NAME.xml`."""

    faces: Mapping[str, Face]
    rounds: Mapping[str, RoundFace]
    volume: float
    """[m^3]."""
    centroid: Array
    """(3,), [m]."""
    inertia: Array
    """(3, 3), about the centroid, for density 1, [m^5]."""
    density: float
    """[kg/m^3]."""
    friction: tuple[float, ...]
    """Sliding, then torsional, then rolling, as in MJCF; missing values are those of the geoms."""
    title: str
    """Name for people, in any letters; empty if not stated."""


def read_stated_part(path: Path) -> StatedPart:
    """Read the TOML file next to a part file.

    Raises:
        InputError: The file is not valid; the message names file and place.
    """
    top = read_typed(path, MatterTable, "file that states the faces of a part", limit=LARGEST_PART_BYTES)
    faces = [_face(name, value, f"{path}, faces, {name}") for name, value in top.faces.items()]
    return StatedPart(
        faces={face.name: face for face in faces if isinstance(face, Face)},
        rounds={face.name: face for face in faces if isinstance(face, RoundFace)},
        volume=1e-9 * top.volume_mm3,
        centroid=1e-3 * np.array(top.centroid_mm),
        inertia=1e-15 * _inertia(top.inertia_mm5, f"{path}, inertia_mm5"),
        density=top.density,
        friction=top.friction if isinstance(top.friction, tuple) else (top.friction,),
        title=top.title,
    )


def _face(name: str, value: Any, place: str) -> Face | RoundFace:
    """The face of one entry of `[faces]`."""
    require(is_name(name), f"{place}: letters, digits and underscores after a letter are needed as a name.")
    table: FaceTable = convert_typed(value, FaceTable, place)  # type: ignore[arg-type]
    return _plane(name, table, place) if isinstance(table, PlaneTable) else _round(name, table, place)


def _plane(name: str, table: PlaneTable, place: str) -> Face:
    """The flat face of a table, after checking that its rings are flat, oriented and do not cross."""
    outline = np.array(table.outline_mm)
    holes = [np.array(hole) for hole in table.holes_mm]
    across = twice_area(outline)
    require(np.linalg.norm(across) >= 2.0 * _SMALLEST_MM2, f"{place}, outline_mm: corners around an area are needed.")
    n = across / np.linalg.norm(across)
    off = np.abs((np.concatenate([outline, *holes]) - outline[0]) @ n).max()
    require(off <= _FLAT_MM, f"{place}: corners within {_FLAT_MM:g} mm of one plane are needed, one is {off:.3g} off.")
    valid = make_flat_area(outline, holes, find_plane_across(n)).is_valid
    require(valid, f"{place}: an outline and holes inside it that do not cross are needed.")
    clockwise = all(twice_area(hole) @ n < 0.0 for hole in holes)
    require(clockwise, f"{place}, holes_mm: corners clockwise as seen from outside are needed.")
    return Face(name, 1e-3 * outline, tuple(1e-3 * hole for hole in holes), table.fit)


def twice_area(ring: Array) -> Array:
    """Twice the area of a ring (k, 3) as a vector (3,) along its normal, by the right-hand rule."""
    corners = ring - ring[0]
    return np.cross(corners, np.roll(corners, -1, axis=0)).sum(axis=0)


def _round(name: str, table: CylinderTable | ConeTable | RimTable, place: str) -> RoundFace:
    """The round face of a table, after checking radii, span and extent."""
    axis = _unit(table.axis, f"{place}, axis")
    radii = table.radii_mm if isinstance(table, ConeTable) else (table.radius_mm, table.radius_mm)
    ends = (1e-3 * radii[0], 1e-3 * radii[1])
    point = 1e-3 * np.array(table.at_mm)
    if isinstance(table, RimTable):
        return RoundFace(name, point, axis, (0.0, 0.0), ends, table.hole)
    differ = not isinstance(table, ConeTable) or abs(radii[1] - radii[0]) >= _SHORTEST_MM
    require(differ, f'{place}, radii_mm: two radii that differ are needed, else kind = "cylinder".')
    low, high = table.span_mm
    require(high - low >= _SHORTEST_MM, f"{place}, span_mm: a start and an end that is greater are needed.")
    extent = WHOLE_TURN if table.extent_deg is None else np.radians(table.extent_deg)
    partial = extent < WHOLE_TURN - 1e-9
    both = partial == (table.toward is not None)
    require(both, f"{place}: extent_deg below 360 and toward are needed together, or none of them.")
    return RoundFace(
        name=name,
        point=point,
        axis=axis,
        span=(1e-3 * low, 1e-3 * high),
        radii=ends,
        hole=table.hole,
        fit=table.fit,
        extent_rad=float(extent),
        toward=None if table.toward is None else _across(table.toward, axis, f"{place}, toward"),
    )


def _unit(stated: Triple, place: str) -> Array:
    """The unit vector (3,) of a stated direction."""
    v = np.array(stated)
    length = float(np.linalg.norm(v))
    require(_UNIT < length < 1.0 / _UNIT, f"{place}: a direction, three numbers that are not all 0, is needed.")
    return np.asarray(v / length)


def _across(stated: Triple, axis: Array, place: str) -> Array:
    """The unit vector (3,) of a stated direction, made exactly orthogonal to the axis."""
    v = _unit(stated, place)
    require(abs(v @ axis) <= 1e-3, f"{place}: a direction across the axis is needed.")
    v = v - (v @ axis) * axis
    return np.asarray(v / np.linalg.norm(v))


def _inertia(six: tuple[float, ...], place: str) -> Array:
    """The inertia (3, 3) of xx, yy, zz, xy, xz, yz; an `InputError` unless it is positive definite."""
    xx, yy, zz, xy, xz, yz = six
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    solid = np.abs(J).max() < 1e30 and np.linalg.eigvalsh(J)[0] > 0.0
    require(solid, f"{place}: xx, yy, zz, xy, xz, yz of a solid are needed.")
    return J
