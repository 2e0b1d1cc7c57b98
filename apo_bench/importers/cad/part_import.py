"""Import the solids of a CAD file as part files: convex pieces, and faces that can make contacts."""

from collections.abc import Container, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, final

import numpy as np
from shapely import Polygon

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array, Face, RoundFace, Solid, intersect_rays, measure_face_area
from apo_bench.importers.cad.contact_faces import make_contact_faces
from apo_bench.importers.cad.faces.facets import FEWEST_SIDES
from apo_bench.importers.cad.faces.regions import find_regions
from apo_bench.importers.cad.joined_solids import join_near_solids, number_solids
from apo_bench.importers.cad.meshes.mesh_file import CadFile, read_meshes
from apo_bench.importers.cad.meshes.shells import split_into_solids
from apo_bench.importers.cad.moments import compute_piece_moments, compute_solid_moments
from apo_bench.importers.cad.pieces.convex_cutting import CutSolid, cut_solid
from apo_bench.importers.cad.solids import (
    Mesh,
    RawSolid,
    SolidPlace,
    clean_title,
    make_hull_solid,
    merge_copies,
    name_regions,
)
from apo_bench.importers.cad.step.step_file import STEP_SUFFIXES, read_step
from apo_bench.scenario.parts import load_part
from apo_bench.scenario.parts.face_checks import FaceError, check_faces, find_supported_area
from apo_bench.scenario.parts.limits import DENSITY, HEAVIEST_KG, LIGHTEST_KG, MOST_CORNERS_IN_ALL, MOST_FACES
from apo_bench.scenario.parts.making import Body, build_solid, write_part
from apo_bench.scenario.parts.making.moments import Moments

_RAYS = 720  # around the axis, by which the free radius of a hole is measured
_LEAST_SHARE = 0.5
"""The share of a flat face that must lie on pieces, if some pieces are hulls of free-form shapes."""
_NEARLY_ALL = 0.98
"""The share of a flat face that must lie on pieces otherwise."""
_SLIVERS = 0.01
"""Pieces may omit this share of the volume as slivers; then the moments are those of the pieces."""
# Why a filled hole can make no contact.
_FILLED = "the hole is filled: with all of its round holes the part would take too many convex pieces"


@final
@dataclass(frozen=True, eq=False)
class ImportedPart:
    """A part that was imported and written."""

    path: Path  # the part file
    raw: RawSolid
    solid: Solid  # the part as read back from its file
    cut: CutSolid
    refused: Mapping[str, str]
    """Faces that can make no contact -> the reason."""
    shares: Mapping[str, float]
    """Flat face -> the share of its area that the pieces support; only faces below 1."""
    free_mm: Mapping[str, float]
    """Hole -> the largest radius free of pieces around its axis, [mm]."""


def read_raw_solids(
    path: Path, unit: str | None, fewest_sides: int = FEWEST_SIDES, lenient: bool = False, is_component: bool = False
) -> tuple[CadFile, list[RawSolid]]:
    """Read the solids of a CAD file with named faces: stated in STEP files, fitted to triangles in meshes.

    Args:
        unit: Unit of a mesh file; None: as stated or guessed.
        fewest_sides: Smallest number of facets of a round face around a full turn in a mesh.
        lenient: Whether the convex hull stands for a solid whose surface is open or crosses itself.
        is_component: Whether solids of a mesh that lie next to each other are one part. In STEP files of several
            components they always are.

    Raises:
        InputError: The file cannot be read, or holds no closed solid.
    """
    if path.suffix.lower() in STEP_SUFFIXES:
        return read_step(path, unit, lenient)
    file, meshes = read_meshes(path, unit)
    join = join_near_solids if is_component else number_solids
    solids = merge_copies(raw for name, mesh in meshes for raw in join(_split_mesh(path, name, mesh, lenient)))
    return file, [replace(raw, regions=name_regions(raw.mesh, find_regions(raw.mesh, fewest_sides))) for raw in solids]


def _split_mesh(path: Path, name: str, mesh: Mesh, lenient: bool) -> list[RawSolid]:
    """Return the solids of a mesh, or if allowed its convex hull where it is no closed surface."""
    try:
        return list(split_into_solids(path, name, mesh))
    except InputError as error:
        if not lenient:
            raise
        return [make_hull_solid(name, mesh.corners, (SolidPlace(name, np.eye(4)),), str(error))]


def import_solid(
    raw: RawSolid,
    name: str,
    folder: Path,
    source: str,
    density: float = 1000.0,
    others: Array | None = None,
    pieces: CutSolid | None = None,
) -> ImportedPart:
    """Import one solid: write `NAME.xml` and `NAME.toml`, and read the part back.

    Args:
        source: The name of the file, for messages and the part file.
        density: [kg/m^3].
        others: Points of other solids that come near, (k, 3), [mm], where pieces must be finest; None: unknown.
        pieces: Its convex pieces; None: the solid is cut exactly.

    Raises:
        InputError: It has more faces or pieces than a part may have, or is too light or too heavy for one.
    """
    density, repairs = _choose_density(source, raw.mesh.volume, density)
    raw = replace(raw, repairs=(*raw.repairs, *repairs))
    flats, rounds, refused = make_contact_faces(raw)
    require(
        flats or rounds, f"{source}: no face of the part is flat or round, so it can touch nothing; draw one that is."
    )
    try:
        pieces = cut_solid(raw, others) if pieces is None else pieces
    except InputError as error:
        raise InputError(f"{source}: {error}") from error
    refused |= dict.fromkeys(pieces.filled, _FILLED)
    possible_moments = _list_possible_moments(source, raw, pieces)
    body = Body(pieces.pieces, tuple(flats), tuple(rounds), possible_moments[0])
    body, shares = _keep_held_faces(
        _remove_faces(body, refused), _LEAST_SHARE if pieces.hulls else _NEARLY_ALL, refused
    )
    body = _keep_largest_faces(body, refused)
    require(body.flats or body.rounds, f"{source}: no flat or round face of the part is left; draw a simpler one.")
    stated: dict[str, Any] = {"color": raw.places[0].color} if raw.places[0].color else {}
    title = clean_title(raw.name) if raw.name != name else ""
    stated |= {"density": density, "source": source, "title": title, "licence": "as that file"}
    # Of boxes that stand for more detailed shapes, the faces are not those of their union.
    stated["by_sites"] = others is None
    for moments in possible_moments:
        try:
            path, solid = _write_checked(name, replace(body, moments=moments), folder, stated, refused)
            break
        except _FaultyPart as error:
            fault = error
    else:  # no moments gave a part that could be read
        raise InputError(
            f"{source}: no shape for collisions agrees with the solid; leave out fillets and small details."
        ) from fault
    free = {wall.name: 1e3 * _measure_free_radius(solid, wall) for wall in solid.rounds.values() if wall.hole}
    return ImportedPart(path, raw, solid, pieces, refused, shares, free)


class _FaultyPart(Exception):
    """A written part whose shape for collisions does not agree with the solid."""


def _write_checked(
    name: str, body: Body, folder: Path, stated: Mapping[str, Any], refused: dict[str, str]
) -> tuple[Path, Solid]:
    """Write a part and read it back, without the faces that do not agree with its pieces.

    Args:
        stated: Further arguments of `write_part`.
        refused: Gets the omitted faces with the reason.

    Raises:
        InputError: The part cannot be written.
        _FaultyPart: It cannot be read back.
    """
    while True:
        path = write_part(name, body, folder, **stated)
        try:
            return path, load_part(path)
        except InputError as error:
            path.unlink()
            path.with_suffix(".toml").unlink(missing_ok=True)
            if not isinstance(error, FaceError):
                raise _FaultyPart from error
            refused[error.face] = error.reason
            body = _remove_faces(body, {error.face})


def _choose_density(source: str, volume: float, density: float) -> tuple[float, tuple[str, ...]]:
    """Return the density of a part, [kg/m^3], and what was changed: a part that is too light for a simulation gets
    the least mass.

    Args:
        volume: [mm^3].

    Raises:
        InputError: No density within the limits gives an allowed mass.
    """
    weight = 1e-9 * density * volume
    raised = max(density, LIGHTEST_KG / (1e-9 * volume)) if volume > 0.0 else np.inf
    require(
        raised <= DENSITY[1] and weight <= HEAVIEST_KG,
        f"{source}: the part weighs {1e3 * weight:.3g} g at {density:g} kg/m^3; "
        f"{1e3 * LIGHTEST_KG:g} g to {HEAVIEST_KG / 1e3:g} t are allowed.",
    )
    if raised == density:
        return density, ()
    return raised, (f"it weighs {1e3 * weight:.3g} g, and is simulated with {1e3 * LIGHTEST_KG:g} g",)


def _keep_largest_faces(body: Body, refused: dict[str, str]) -> Body:
    """Return the body with its round faces and its largest flat ones, as many as a part may have.

    Args:
        refused: Gets the omitted faces with the reason.
    """
    large_first = sorted(body.flats, key=lambda face: -measure_face_area(face))
    omitted = [face.name for face in large_first[max(0, MOST_FACES - len(body.rounds)) :]]
    refused |= dict.fromkeys(omitted, f"it is smaller than {MOST_FACES} other faces, which are the most")
    return _remove_faces(body, refused)


def _list_possible_moments(source: str, raw: RawSolid, pieces: CutSolid) -> list[Moments]:
    """Return the moments to try: of the solid, then of its pieces if these omit no more than slivers, [m].

    Raises:
        InputError: Pieces have too many corners, or the pieces of a solid with only flat faces do not fill its volume.
    """
    corners = sum(len(piece.corners) for piece in pieces.pieces)
    most = f"{MOST_CORNERS_IN_ALL:,} are the most, so leave out small holes and fillets"
    require(corners <= MOST_CORNERS_IN_ALL, f"{source}: the shape for collisions has {corners:,} corners; {most}.")
    own = compute_piece_moments(pieces.pieces)
    if pieces.coarse or pieces.hulls or pieces.filled:
        return [own]
    if all(region.kind == "plane" for region in raw.regions):
        filled = 1e9 * own.size
        require(
            abs(filled - raw.mesh.volume) <= _SLIVERS * raw.mesh.volume,
            f"{source}: the solid has {raw.mesh.volume:.6g} mm^3, its shape for collisions {filled:.6g} mm^3; its "
            "surface may cross itself, so repair it in its CAD program.",
        )
    moments = compute_solid_moments(raw)
    return [moments, own] if abs(own.size - moments.size) < _SLIVERS * own.size else [moments]


def _remove_faces(body: Body, names: Container[str]) -> Body:
    """Return the body without the named faces."""
    flats = tuple(face for face in body.flats if face.name not in names)
    rounds = tuple(face for face in body.rounds if face.name not in names)
    return replace(body, flats=flats, rounds=rounds)


def _keep_held_faces(body: Body, least: float, refused: dict[str, str]) -> tuple[Body, dict[str, float]]:
    """Return the body with the faces that its pieces support, and the shares of partly supported flat faces.

    A flat face is trimmed to the supported share if that is large enough.

    Args:
        least: Smallest share of a flat face that must be supported.
        refused: Gets the omitted faces with the reason.
    """
    solid = build_solid("part", body)
    flats = {face.name: face for face in body.flats}
    shares: dict[str, float] = {}
    faces: list[Face | RoundFace] = [*body.flats, *body.rounds]
    for face in faces:
        if not (reason := _describe_fault(solid, face)):
            continue
        less = find_supported_area(face, solid.pieces) if isinstance(face, Face) else None
        if less is not None and less[1] > least and not _describe_fault(solid, less[0]):
            flats[face.name], shares[face.name] = less
        else:
            refused[face.name] = reason
    return _remove_faces(replace(body, flats=tuple(flats.values())), refused), shares


def _describe_fault(solid: Solid, face: Face | RoundFace) -> str:
    """Return the reason why a face does not agree with the pieces; empty if it does."""
    if isinstance(face, Face):
        across = np.argsort(np.abs(face.normal))[:2]  # the two axes most nearly square to the normal
        if not Polygon(face.outline[:, across], [hole[:, across] for hole in face.holes]).is_valid:
            return "its outline crosses itself"
    flat, wall = ({face.name: face}, {}) if isinstance(face, Face) else ({}, {face.name: face})
    try:
        check_faces(replace(solid, faces=flat, rounds=wall), Path("part"))
    except FaceError as error:
        return error.reason
    return ""


def _measure_free_radius(solid: Solid, wall: RoundFace) -> float:
    """Return the distance of the pieces from the axis of a hole, at its narrow end, [m]."""
    angle = 2.0 * np.pi * np.arange(_RAYS) / _RAYS
    out = np.outer(np.cos(angle), wall.frame[:3, 0]) + np.outer(np.sin(angle), wall.frame[:3, 1])
    share = 0.5  # height of the measurement, as a share of the length
    if wall.kind == "cone":
        share = 0.02 if wall.radii[0] < wall.radii[1] else 0.98
    at = wall.point + (wall.span[0] + share * wall.length) * wall.axis
    nearest = np.inf
    for piece in solid.pieces:
        enter, leave = intersect_rays(piece.planes, at, out)
        nearest = min(nearest, np.maximum(enter, 0.0)[leave > 0.0].min(initial=np.inf))
    return float(nearest)
