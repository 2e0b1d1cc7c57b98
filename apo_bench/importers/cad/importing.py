"""A CAD file becomes part files: raw solids, names, pieces, and faces that can make contacts."""

import os
import re
from collections.abc import Container, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, final

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array, Face, Hull, RoundFace, Solid, passage
from apo_bench.importers.cad.contact_faces import contact_faces
from apo_bench.importers.cad.faces.facets import FEWEST_SIDES
from apo_bench.importers.cad.faces.regions import regions_of
from apo_bench.importers.cad.meshes.mesh_file import CadFile, read_meshes
from apo_bench.importers.cad.meshes.shells import closed_solids
from apo_bench.importers.cad.moments import moments_of_pieces, solid_moments
from apo_bench.importers.cad.pieces.cutting import Cut, cut
from apo_bench.importers.cad.solids.naming import title_of, with_names
from apo_bench.importers.cad.solids.raw_solid import RawSolid, without_copies
from apo_bench.importers.cad.step.step_file import STEP_SUFFIXES, read_step
from apo_bench.scenario.parts import load_part
from apo_bench.scenario.parts.agreement import check_faces, supported
from apo_bench.scenario.parts.allowed import HEAVIEST_KG, LIGHTEST_KG, MOST_CORNERS_IN_ALL, MOST_FACES
from apo_bench.scenario.parts.making import Body, solid_of, write_part

_RAYS = 720
_LEAST_SHARE = 0.5
"""So much of a flat face must lie on pieces that stand for free shapes."""
_NEARLY_ALL = 0.98
"""So much of a flat face must lie on other pieces."""
_SLIVERS = 0.01
"""What is left out of pieces as too thin may be so much of the part; then the part has the volume of its pieces."""
_MATTER = re.compile(r"\S+, (volume_mm3|centroid_mm|inertia_mm5): ")
_FACE = re.compile(r"\S+, faces, (\w+): ([^;]*)")
_FILLED = "the hole is filled: with all of its round holes the part would take too many convex pieces"


@final
@dataclass(frozen=True, eq=False)
class Imported:
    """One part that was written."""

    path: Path
    raw: RawSolid
    solid: Solid
    cut: Cut
    refused: Mapping[str, str]
    """Faces that can make no contact, with the reason."""
    shares: Mapping[str, float]
    """What of a flat face is stated, where the pieces do not hold all of it."""
    free_mm: Mapping[str, float]
    """Free radius of each hole that is stated, as the pieces leave it."""


def raw_solids(path: Path, unit: str | None, fewest_sides: int = FEWEST_SIDES) -> tuple[CadFile, list[RawSolid]]:
    """The solids of a file, with named faces: as STEP states them, or fitted to triangles.

    Args:
        fewest_sides: Of a whole turn of a round face in a mesh; what has fewer is so many flat faces.

    Raises:
        InputError: The file cannot be read, or holds no closed solid.
    """
    if path.suffix.lower() in STEP_SUFFIXES:
        return read_step(path, unit)
    file, meshes = read_meshes(path, unit)
    solids = without_copies(raw for name, mesh in meshes for raw in closed_solids(path, name, mesh))
    return file, [replace(raw, regions=with_names(raw.mesh, regions_of(raw.mesh, fewest_sides))) for raw in solids]


def import_part(
    raw: RawSolid,
    name: str,
    folder: Path,
    source: str,
    density: float = 1000.0,
    others: Array | None = None,
    mates: Any = None,
) -> Imported:
    """Write a raw solid as `NAME.xml` and `NAME.toml` that are read as a part.

    Args:
        density: [kg/m^3].
        others: Points of what comes near to it, (k, 3), [mm]: there its pieces are finest; None: nothing is known.
        mates: All others where they are, as one body of manifold3d, [mm]: its pieces keep out of these.

    Raises:
        InputError: It has more faces or pieces than a part may have, or is too light or too heavy for one.
    """
    weight = 1e-9 * density * raw.mesh.volume
    require(
        LIGHTEST_KG <= weight <= HEAVIEST_KG,
        f"{source}: the part weighs {1e3 * weight:.3g} g at {density:g} kg/m^3; "
        f"{1e3 * LIGHTEST_KG:g} g to {HEAVIEST_KG / 1e3:g} t are allowed.",
    )
    flats, rounds, refused = contact_faces(raw)
    _check_touches(source, (*flats, *rounds))
    try:
        pieces = cut(raw, others, mates)
    except InputError as error:
        raise InputError(f"{source}: {error}") from error
    _check_pieces(source, raw, pieces)
    refused |= dict.fromkeys(pieces.filled, _FILLED)
    body = Body(pieces.pieces, tuple(flats), tuple(rounds), solid_moments(raw, pieces))
    body, shares = _held(_without(body, refused), _LEAST_SHARE if pieces.hulls else _NEARLY_ALL, refused)
    count = len(body.flats) + len(body.rounds)
    require(count <= MOST_FACES, f"{source}: the part has {count} faces; {MOST_FACES} are the most.")
    stated: dict[str, Any] = {"color": raw.places[0].color} if raw.places[0].color else {}
    stated |= {"density": density, "source": source, "title": title_of(raw.name) if raw.name != name else ""}
    while True:
        _check_touches(source, (*body.flats, *body.rounds))
        path = write_part(name, body, folder, licence="as that file", **stated)
        try:
            solid = load_part(path)
            break
        except InputError as error:
            body = _mended(body, path, error, refused, source)
    free = {wall.name: 1e3 * _free_radius(solid, wall) for wall in solid.rounds.values() if wall.hole}
    return Imported(path, raw, solid, pieces, refused, shares, free)


def _check_touches(source: str, faces: Container[Face | RoundFace]) -> None:
    require(faces, f"{source}: no face of the part is flat or round, so it could touch nothing; draw one that is.")


def _check_pieces(source: str, raw: RawSolid, pieces: Cut) -> None:
    """Raise an `InputError` if pieces are too many, or those of flat faces do not fill the volume that the file has."""
    corners = sum(len(piece.corners) for piece in pieces.pieces)
    most = f"{MOST_CORNERS_IN_ALL:,} are the most, so leave out small holes and fillets"
    require(
        corners <= MOST_CORNERS_IN_ALL, f"{source}: the convex pieces of the part have {corners:,} corners; {most}."
    )
    if all(region.kind == "plane" for region in raw.regions):
        filled = 1e9 * moments_of_pieces(pieces.pieces).size
        has = f"the file has {raw.mesh.volume:.6g} mm^3, and the convex pieces of the part {filled:.6g} mm^3"
        is_filled = abs(filled - raw.mesh.volume) <= _SLIVERS * raw.mesh.volume
        require(is_filled, f"{source}: {has}; its surface may cross itself, so mend it where it was drawn.")


def _without(body: Body, names: Container[str]) -> Body:
    """A body without some of its faces."""
    return replace(
        body,
        flats=tuple(face for face in body.flats if face.name not in names),
        rounds=tuple(face for face in body.rounds if face.name not in names),
    )


def _held(body: Body, least: float, refused: dict[str, str]) -> tuple[Body, dict[str, float]]:
    """A body with those faces that its pieces hold; of flat ones as much as they hold, and how much that is.

    Args:
        least: So much of a flat face must be held.
        refused: Is added to.
    """
    solid = solid_of("part", body)
    flats = {face.name: face for face in body.flats}
    shares: dict[str, float] = {}
    faces: list[Face | RoundFace] = [*body.flats, *body.rounds]
    for face in faces:
        if not (reason := _why_not(solid, face)):
            continue
        less = supported(face, solid.pieces) if isinstance(face, Face) else None
        if less is not None and less[1] > least and not _why_not(solid, less[0]):
            flats[face.name], shares[face.name] = less
        else:
            refused[face.name] = reason
    return _without(replace(body, flats=tuple(flats.values())), refused), shares


def _mended(body: Body, path: Path, error: InputError, refused: dict[str, str], source: str) -> Body:
    """What a body is without what its files are refused for: they are a little rounded.

    Args:
        refused: Is added to.
    """
    why = str(error).replace(f"{path.parent}{os.sep}", "").removeprefix(f"{path.name}: ")
    path.unlink()
    path.with_suffix(".toml").unlink(missing_ok=True)
    if _MATTER.match(why):
        own = moments_of_pieces(body.pieces)
        if 0.0 < abs(own.size - body.moments.size) < _SLIVERS * own.size:
            return replace(body, moments=own)
    face = _FACE.match(why)
    if face is None or face[1] in refused:
        cause = why.split("; ")[0].rstrip(".")
        raise InputError(f"{source}: its convex pieces make no part ({cause}); leave out fillets.") from error
    refused[face[1]] = face[2]
    return _without(body, refused)


def _why_not(solid: Solid, face: Face | RoundFace) -> str:
    """Why a face is not as the pieces are; empty if it is."""
    from shapely import Polygon

    if isinstance(face, Face):
        across = np.argsort(np.abs(face.normal))[:2]
        if not Polygon(face.outline[:, across], [hole[:, across] for hole in face.holes]).is_valid:
            return "its outline crosses itself"
    flat, wall = ({face.name: face}, {}) if isinstance(face, Face) else ({}, {face.name: face})
    try:
        check_faces(replace(solid, faces=flat, rounds=wall), Path("part"))
    except InputError as error:
        return str(error).split(": ", 1)[-1].split("; ")[0]
    return ""


def _free_radius(solid: Solid, wall: RoundFace) -> float:
    """How far the pieces are from the axis of a hole, where it is narrowest, [m]."""
    angle = 2.0 * np.pi * np.arange(_RAYS) / _RAYS
    out = np.outer(np.cos(angle), wall.frame[:3, 0]) + np.outer(np.sin(angle), wall.frame[:3, 1])
    share = 0.5
    if wall.kind == "cone":
        share = 0.02 if wall.radii[0] < wall.radii[1] else 0.98
    at = wall.point + (wall.span[0] + share * wall.length) * wall.axis
    reach = 2.0 * max(wall.radii)
    ways = (
        passage(piece.planes, at, out)
        for piece in solid.pieces
        if isinstance(piece, Hull) and np.abs(at - piece.center).max() < piece.half.max() + reach
    )
    return min(
        (float(np.maximum(enter, 0.0)[leave > 0.0].min(initial=np.inf)) for enter, leave in ways), default=np.inf
    )
