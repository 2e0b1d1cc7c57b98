"""Load a part file as a solid with named faces."""

from collections import Counter
from pathlib import Path

from apo_bench.errors import InputError, require, require_known
from apo_bench.geometry import Box, Face, Solid
from apo_bench.resources import folder
from apo_bench.scenario.parts.box_union import SIDES, UnnamedFace, unite
from apo_bench.scenario.parts.limits import HEAVIEST_KG, LIGHTEST_KG, MOST_FACES
from apo_bench.scenario.parts.mass_checks import check_part
from apo_bench.scenario.parts.part_file import NamedSite, PartFile, read_part
from apo_bench.scenario.parts.stated_properties import StatedPart

_ON_FACE_M = 1e-6
"""A site lies on a face if it is nearer to its plane and farther from its edges than this."""


def list_part_names() -> tuple[str, ...]:
    """The short names of the parts that come with the package."""
    return tuple(sorted(path.stem for path in (folder("assets") / "parts").glob("*.xml")))


def find_part_path(given: str | Path) -> Path:
    """The path of the part file that a short name or a path refers to.

    Raises:
        InputError: No part has that short name.
    """
    if isinstance(given, Path) or given.endswith(".xml") or "/" in given or "\\" in given:
        return Path(given)
    require_known("part", given, list_part_names(), rest=" Or give the path of an MJCF file, ending in .xml.")
    return folder("assets") / "parts" / f"{given}.xml"


def load_part(given: str | Path, checked: bool = True) -> Solid:
    """Load the solid of a part file; it is named after the file.

    A part of boxes is their union, with faces named by the sites that lie on them. Faces without a site are called
    `auto_px_1`, ...: outward direction and a number. For other pieces, `NAME.toml` next to the file states faces,
    volume, centroid and inertia. Files from outside of the package are checked against a mesh of their pieces.

    Args:
        given: The short name of a part of the package, or the path of an MJCF file.
        checked: False skips that check, for a file that the package has just written.

    Raises:
        InputError: The file breaks a rule; the message names file, element and remedy.
    """
    file = read_part(find_part_path(given))
    solid = _build_stated_solid(file, file.stated) if file.stated else _build_box_union(file)
    mass = file.density * solid.volume
    require(
        LIGHTEST_KG <= mass <= HEAVIEST_KG,
        f"{file.path}: the part weighs {mass:.3g} kg; from {LIGHTEST_KG:g} to {HEAVIEST_KG:g} kg are allowed, "
        "so change its size or its density.",
    )
    if checked and file.path.parent != folder("assets") / "parts":
        check_part(file, solid)
    return solid


def _build_stated_solid(file: PartFile, stated: StatedPart) -> Solid:
    """The solid of convex pieces, with the faces, volume, centroid and inertia of its TOML file."""
    return Solid(
        file.path.stem,
        stated.faces,
        file.pieces,
        stated.centroid,
        stated.volume,
        rounds=stated.rounds,
        inertia=stated.inertia,
    )


def _build_box_union(file: PartFile) -> Solid:
    """The solid of a part of boxes: their union, with faces named by its sites."""
    boxes = tuple(piece for piece in file.pieces if isinstance(piece, Box))
    union = unite(boxes, MOST_FACES + 1)
    require(
        union.pieces == 1, f"{file.path}: the boxes make {union.pieces} separate solids; a part is one rigid piece."
    )
    require(
        len(union.surfaces) <= MOST_FACES,
        f"{file.path}: the boxes make more than {MOST_FACES} faces, the most that a part may have.",
    )
    marks = dict[int, NamedSite]()
    for each in file.marks:
        k = _find_surface_under(file, each, union.surfaces)
        require(
            k not in marks, f"{file.path}: site '{each.name}' lies on a face that another one marks; keep one of them."
        )
        marks[k] = each
    counts = Counter[int]()
    faces = list[Face]()
    for k, surface in enumerate(union.surfaces):
        counts[surface.side] += 1
        outline, *holes = surface.rings()
        mark = marks.get(k)
        name = mark.name if mark else f"auto_{SIDES[surface.side]}_{counts[surface.side]}"
        faces.append(Face(name, outline, tuple(holes), fit=bool(mark and mark.fit)))
    faces.sort(key=lambda face: face.name.startswith("auto_"))
    return Solid(file.path.stem, {face.name: face for face in faces}, boxes, union.centroid, union.volume)


def _find_surface_under(file: PartFile, mark: NamedSite, surfaces: tuple[UnnamedFace, ...]) -> int:
    """The index of the surface on which a site lies; an `InputError` if it lies on an edge or on no surface."""
    from shapely import Point

    where = ", ".join(f"{1e3 * x:g}" for x in mark.point)
    for k, surface in enumerate(surfaces):
        if abs(mark.point[surface.axis] - surface.height) > _ON_FACE_M:
            continue
        point = Point(surface.flat(mark.point[None])[0])
        if surface.shape.distance(point) > _ON_FACE_M:
            continue
        require(
            surface.shape.boundary.distance(point) > _ON_FACE_M,
            f"{file.path}: site '{mark.name}' at ({where}) mm lies on an edge between faces; move it into one face.",
        )
        return k
    raise InputError(f"{file.path}: site '{mark.name}' at ({where}) mm lies on no face; move it onto the surface.")
