"""A part file becomes a solid with named faces.

A second opinion on a solid: the mesh that manifold3d makes of its pieces, measured by trimesh; one piece or more?
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.errors import InputError, require, require_known
from apo_bench.geometry import Box, Face, Piece, Solid, face_area, separating_axes, shadow
from apo_bench.parts.agreement import check_faces, check_receding
from apo_bench.parts.allowed import HEAVIEST_KG, LIGHTEST_KG, MOST_FACES
from apo_bench.parts.faces import SIDES, Surface, unite
from apo_bench.parts.part_file import Mark, PartFile, read_part
from apo_bench.parts.stated import StatedPart
from apo_bench.resources import folder

_TOUCHING_M = 2e-5
"""Thinner layers of a solid may be left out between its pieces."""
_MOST_TESTS = 10_000
"""Pairs of pieces with boxes that overlap, of which it is not known yet that they belong together."""
_APART_M = 1e-8
"""The largest distance between the surfaces of the two; planes of boxes are one within a tenth of it."""
_SHARE = 1e-3
"""Of the volume."""


def check_solid(solid: Solid, file: str) -> None:
    """Raise an `InputError` unless the boxes make a closed mesh that the faces enclose, with this volume and centroid.

    Both packages are slow to import and are so only here.
    """
    mesh = _mesh(solid)
    require(
        mesh.is_watertight,
        f"{file}: the boxes make no closed solid; move apart, or into each other, what nearly touches.",
    )
    room = _APART_M * float(mesh.area)
    reach = float(np.linalg.norm(np.diff(solid.bounds, axis=0)))
    # Divergence theorem: the volume inside of flat faces is a third of the sum of area times height over the origin.
    enclosed = sum(face_area(face) * float(face.normal @ face.outline[0]) for face in solid.faces.values()) / 3.0
    for name, volume in (("of its cells", solid.volume), ("that its faces enclose", enclosed)):
        require(
            abs(volume - mesh.volume) <= room,
            f"{file}: the volume {name} is {1e9 * volume:.6g} mm^3, that of a mesh of the same boxes "
            f"{1e9 * mesh.volume:.6g}; move apart, or into each other, what nearly touches.",
        )
    off = float(np.linalg.norm(mesh.center_mass - solid.centroid))
    require(
        off * solid.volume <= room * reach,
        f"{file}: the centroid is {1e3 * off:.3g} mm from that of a mesh of the same boxes.",
    )


def check_matter(solid: Solid, file: str, rounded: float) -> None:
    """Raise an `InputError` unless volume, centroid and inertia are those of the pieces, within 0.1 percent.

    Args:
        rounded: By how much round walls that are cut into flat ones may change the volume, [m^3].
    """
    assert solid.inertia is not None
    mesh = _mesh(solid)
    room = _SHARE * solid.volume + rounded
    reach = float(np.linalg.norm(np.diff(solid.bounds, axis=0)))
    require(
        abs(solid.volume - mesh.volume) <= room,
        f"{file}, volume_mm3: {1e9 * solid.volume:.6g} is stated, the pieces have {1e9 * mesh.volume:.6g}; only "
        "0.1 % and what round walls explain are allowed; state that of the exact solid, or mend the pieces.",
    )
    off = np.abs(mesh.center_mass - solid.centroid).max()
    if off * solid.volume > room * reach:
        at = ", ".join(f"{1e3 * x:.5g}" for x in mesh.center_mass)
        raise InputError(f"{file}, centroid_mm: that of the pieces is ({at}), {1e3 * off:.3g} mm from it; state that.")
    J = np.asarray(mesh.moment_inertia)
    if np.abs(J - solid.inertia).max() > room * reach**2 / 3.0:
        six = ", ".join(f"{1e15 * J[i, k]:.5g}" for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
        raise InputError(f"{file}, inertia_mm5: that of the pieces about their centroid is [{six}]; state that.")


def _mesh(solid: Solid) -> Any:
    """The union of the pieces as a mesh; vertices stay apart where the surface touches itself."""
    import manifold3d
    import trimesh

    pieces = [
        manifold3d.Manifold.cube(2.0 * piece.half, center=True).translate(piece.center)
        if isinstance(piece, Box)
        else manifold3d.Manifold.hull_points(piece.corners)
        for piece in solid.pieces
    ]
    mesh = manifold3d.Manifold.batch_boolean(pieces, manifold3d.OpType.Add).to_mesh64()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False)


def check_one_piece(pieces: Sequence[Piece], path: Path) -> None:
    """Raise an `InputError` unless every piece touches the others, over some of them."""
    groups = touching_groups(pieces)
    require(groups is not None, f"{path}: whether the pieces touch takes too long to find out; use fewer pieces.")
    assert groups is not None
    require(
        len(groups) <= 1,
        f"{path}: the pieces make {len(groups)} separate solids; a part is one rigid piece.",
    )


def touching_groups(pieces: Sequence[Piece]) -> list[set[int]] | None:
    """Which pieces touch each other, over some of them; None if that takes too long to find out."""
    from scipy.cluster.hierarchy import DisjointSet

    solids = DisjointSet(range(len(pieces)))
    tests = 0
    low = np.array([piece.center - piece.half for piece in pieces]) - _TOUCHING_M
    high = np.array([piece.center + piece.half for piece in pieces]) + _TOUCHING_M
    for i in range(len(pieces)):
        for k in np.flatnonzero((low[:i] <= high[i]).all(axis=1) & (high[:i] >= low[i]).all(axis=1)):
            if solids.connected(i, int(k)):
                continue
            tests += 1
            if tests > _MOST_TESTS:
                return None
            if _gap(pieces[i], pieces[int(k)]) < _TOUCHING_M:
                solids.merge(i, int(k))
    return list(solids.subsets())


def _gap(a: Piece, b: Piece) -> float:
    """How far two pieces are apart along the direction in which it is most, [m]; negative if they overlap."""
    axes = separating_axes(a, np.eye(3), b, np.eye(3))
    at, reach = shadow(a, np.eye(3), axes)
    on, room = shadow(b, np.eye(3), axes)
    return float((np.abs(at - on) - reach - room).max())


_ON_FACE_M = 1e-6
"""A site lies on a face if it is this near to its plane and this far from its edges."""


def part_names() -> tuple[str, ...]:
    """The short names of the parts that come with the package."""
    return tuple(sorted(path.stem for path in (folder("assets") / "parts").glob("*.xml")))


def part_path(given: str | Path) -> Path:
    """The file a short name or a path stands for.

    Raises:
        InputError: No part has that short name.
    """
    if isinstance(given, Path) or given.endswith(".xml") or "/" in given or "\\" in given:
        return Path(given)
    require_known("part", given, part_names(), rest=" Or give the path of an MJCF file, ending in .xml.")
    return folder("assets") / "parts" / f"{given}.xml"


def load_part(given: str | Path, checked: bool = True) -> Solid:
    """The solid of a part file, named after the file.

    Of boxes alone it is their union, with faces named by the sites that lie on them; those without a site are called
    `auto_px_1`, ...: outward direction, and their number along it. Of other pieces, faces, volume, centroid and inertia
    are those that `NAME.toml` beside it states. What does not come with the package is held against a mesh of the same
    pieces.

    Args:
        given: The short name of a part of the package, or the path of an MJCF file.
        checked: Whether it is held against that mesh; not if the package has just written it.

    Raises:
        InputError: The file breaks a rule; the message names file, element and remedy.
    """
    file = read_part(part_path(given))
    solid = _stated(file, file.stated) if file.stated else _united(file)
    mass = file.density * solid.volume
    require(
        LIGHTEST_KG <= mass <= HEAVIEST_KG,
        f"{file.path}: the part weighs {mass:.3g} kg; from {LIGHTEST_KG:g} to {HEAVIEST_KG:g} kg are allowed, "
        "so change its size or its density.",
    )
    if checked and file.path.parent != folder("assets") / "parts":
        check_part(file, solid)
    return solid


def check_part(file: PartFile, solid: Solid) -> None:
    """Raise an `InputError` unless what is stated of a part is so of its pieces."""
    if file.stated is None:
        check_solid(solid, str(file.path))
        return
    check_one_piece(solid.pieces, file.path)
    beside = file.path.with_suffix(".toml")
    check_matter(solid, str(beside), check_faces(solid, beside))
    check_receding(solid, beside)


def _stated(file: PartFile, stated: StatedPart) -> Solid:
    """The solid of any convex pieces, with the faces that are stated."""
    return Solid(
        file.path.stem,
        stated.faces,
        file.pieces,
        stated.centroid,
        stated.volume,
        rounds=stated.rounds,
        inertia=stated.inertia,
    )


def _united(file: PartFile) -> Solid:
    """The union of boxes, with the faces that sites mark."""
    boxes = tuple(piece for piece in file.pieces if isinstance(piece, Box))
    union = unite(boxes, MOST_FACES + 1)
    require(
        union.pieces == 1, f"{file.path}: the boxes make {union.pieces} separate solids; a part is one rigid piece."
    )
    require(
        len(union.surfaces) <= MOST_FACES,
        f"{file.path}: the boxes make more than {MOST_FACES} faces, the most that a part may have.",
    )
    marks = _matched(file, union.surfaces)
    faces = [_face(surface, marks.get(k), _number(union.surfaces, k)) for k, surface in enumerate(union.surfaces)]
    faces.sort(key=lambda face: face.name.startswith("auto_"))
    return Solid(file.path.stem, {face.name: face for face in faces}, boxes, union.centroid, union.volume)


def _matched(file: PartFile, surfaces: tuple[Surface, ...]) -> dict[int, Mark]:
    """Which mark lies on which surface."""
    marks: dict[int, Mark] = {}
    for mark in file.marks:
        k = _under(file, mark, surfaces)
        if k in marks:
            raise InputError(
                f"{file.path}: sites '{marks[k].name}' and '{mark.name}' lie on one face; keep one of them."
            )
        marks[k] = mark
    return marks


def _under(file: PartFile, mark: Mark, surfaces: tuple[Surface, ...]) -> int:
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


def _number(surfaces: tuple[Surface, ...], k: int) -> int:
    """The place of a surface among those that look the same way, counted from 1, named or not."""
    return 1 + sum(surface.side == surfaces[k].side for surface in surfaces[:k])


def _face(surface: Surface, mark: Mark | None, number: int) -> Face:
    outline, *holes = surface.rings()
    name = mark.name if mark else f"auto_{SIDES[surface.side]}_{number}"
    return Face(name, np.asarray(outline), tuple(holes), fit=bool(mark and mark.fit))
