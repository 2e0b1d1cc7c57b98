"""A CAD file becomes part files: raw solids, names, pieces, faces that can make contacts, and what is said of it."""

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import final

import numpy as np

from apo_bench.cad.cutting import Cut, cut
from apo_bench.cad.matter import matter
from apo_bench.cad.naming import renamed, with_names
from apo_bench.cad.patience import in_time
from apo_bench.cad.raw import RawSolid
from apo_bench.cad.reading import CadFile, read_meshes
from apo_bench.cad.regions import regions_of
from apo_bench.cad.shells import closed_solids
from apo_bench.cad.stating import flat_face, round_face
from apo_bench.cad.step import KINDS as STEP_KINDS
from apo_bench.cad.step import read_step
from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.hull import Hull
from apo_bench.geometry.round_face import RoundFace
from apo_bench.geometry.solid import Face, Solid
from apo_bench.parts import load_part
from apo_bench.parts.agreement import check_faces, supported
from apo_bench.parts.allowed import HEAVIEST_KG, LIGHTEST_KG, MOST_CORNERS_IN_ALL, MOST_FACES
from apo_bench.parts.making import Body, solid_of, write_part

_RAYS = 720
_LEAST_SHARE = 0.5
"""So much of a flat face must lie on the pieces where these stand for free shapes."""


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


def raw_solids(path: Path, unit: str | None) -> tuple[CadFile, list[RawSolid]]:
    """The solids of a file, with named faces: as STEP states them, or fitted to triangles.

    Raises:
        InputError: The file cannot be read, or holds no closed solid.
    """
    with in_time(f"{path}: finding the faces", "save it with fewer triangles"):
        if path.suffix.lower() in STEP_KINDS:
            return read_step(path, unit)
        file = read_meshes(path, unit)
        found = []
        for each in closed_solids(path, file.shapes):
            regions, facets = regions_of(each.mesh)
            named = with_names(each.mesh, regions)
            found.append(RawSolid(each.name, each.mesh, named, facets, each.places, each.said))
        return file, found


def import_part(raw: RawSolid, name: str, folder: Path, source: str, density: float = 1000.0) -> Imported:
    """Write a raw solid as `NAME.xml` and `NAME.toml` that are read as a part.

    Args:
        density: [kg/m^3].

    Raises:
        InputError: It has more faces or pieces than a part may have, or is too light or too heavy for one.
    """
    with in_time(f"{source}: cutting the part into convex pieces", "leave out small holes, fillets and free surfaces"):
        return _imported(raw, name, folder, source, density)


def _imported(raw: RawSolid, name: str, folder: Path, source: str, density: float) -> Imported:
    weight = 1e-9 * density * raw.mesh.volume
    if not LIGHTEST_KG <= weight <= HEAVIEST_KG:
        raise InputError(
            f"{source}: the part weighs {1e3 * weight:.3g} g at {density:g} kg/m^3; {1e3 * LIGHTEST_KG:g} g to "
            f"{HEAVIEST_KG / 1e3:g} t are allowed, so give another --density, or scale the part."
        )
    try:
        found = cut(raw)
    except InputError as error:
        raise InputError(f"{source}: {error}") from error
    corners = sum(len(piece.corners) for piece in found.pieces)
    if corners > MOST_CORNERS_IN_ALL:
        raise InputError(
            f"{source}: the convex pieces of the part have {corners:,} corners; {MOST_CORNERS_IN_ALL:,} are the most, "
            "so leave out small holes and fillets."
        )
    flats, rounds, refused = _faces(raw)
    if len(flats) + len(rounds) > MOST_FACES:
        raise InputError(f"{source}: the part has {len(flats) + len(rounds)} faces; {MOST_FACES} are the most.")
    body = Body(found.pieces, tuple(flats), tuple(rounds), matter(raw, found))
    solid = solid_of(name, body)
    faces: list[Face | RoundFace] = [*flats, *rounds]
    shares: dict[str, float] = {}
    for face in faces:
        reason = _reason(solid, face)
        less = supported(face, solid.pieces) if reason and isinstance(face, Face) and found.hulls else None
        if less is not None and less[1] > _LEAST_SHARE and not _reason(solid, less[0]):
            shares[face.name] = less[1]
            flats = [less[0] if flat is face else flat for flat in flats]
        elif reason:
            refused[face.name] = reason
    body = replace(
        body,
        flats=tuple(f for f in flats if f.name not in refused),
        rounds=tuple(f for f in rounds if f.name not in refused),
    )
    if not (body.flats or body.rounds):
        raise InputError(
            f"{source}: no face of the part is flat or round, so it could touch nothing; draw one that is."
        )
    color = {"color": raw.places[0].color} if raw.places[0].color else {}

    def write(body: Body) -> Path:
        return write_part(name, body, folder, density=density, source=source, licence="as that file", **color)

    path, solid = _as_read(write, body, refused, source)
    free = {wall.name: 1e3 * _free_radius(solid, wall) for wall in solid.rounds.values() if wall.hole}
    return Imported(path, raw, solid, found, refused, shares, free)


def _as_read(write: Callable[[Body], Path], body: Body, refused: dict[str, str], source: str) -> tuple[Path, Solid]:
    """The part as its files are read, which are a little rounded; a face that they no longer have can make no contact.

    Args:
        refused: Is added to.
    """
    while True:
        path = write(body)
        try:
            return path, load_part(path)
        except InputError as error:
            why = str(error).replace(f"{path.parent}{os.sep}", "").removeprefix(f"{path.name}: ")
            path.unlink()
            path.with_suffix(".toml").unlink(missing_ok=True)
            face = re.match(r"\S+, faces, (\w+): ([^;]*)", why)
            left = [f.name for faces in (body.flats, body.rounds) for f in faces]
            if face is None or face[1] not in left or len(left) == 1:
                raise InputError(
                    f"{source}: what the solid was cut into makes no part ({why.split('; ')[0].rstrip('.')}); leave "
                    "out fillets and free surfaces."
                ) from error
            refused[face[1]] = face[2]
            body = replace(
                body,
                flats=tuple(f for f in body.flats if f.name != face[1]),
                rounds=tuple(f for f in body.rounds if f.name != face[1]),
            )


def with_new_names(raw: RawSolid, names: Mapping[str, str]) -> RawSolid:
    """With other names for some faces."""
    return replace(raw, regions=renamed(raw.regions, names))


def _faces(raw: RawSolid) -> tuple[list[Face], list[RoundFace], dict[str, str]]:
    flats: list[Face] = []
    rounds: list[RoundFace] = []
    refused: dict[str, str] = {}
    for region in raw.regions:
        if not region.name:
            continue
        face = round_face(region) if region.is_round else flat_face(raw, region)
        if face is None:
            refused[region.name] = "it is too thin" if region.is_round else "it has more than one outline"
        elif isinstance(face, Face):
            flats.append(face)
        else:
            rounds.append(face)
    return flats, rounds, refused


def _reason(solid: Solid, face: Face | RoundFace) -> str:
    """Why a face is not as the pieces are; empty if it is."""
    if isinstance(face, Face) and not _is_one_area(face):
        return "its outline crosses itself"
    flat, wall = ({face.name: face}, {}) if isinstance(face, Face) else ({}, {face.name: face})
    try:
        check_faces(replace(solid, faces=flat, rounds=wall), Path("part"))
    except InputError as error:
        return str(error).split(": ", 1)[-1].split("; ")[0]
    return ""


def _is_one_area(face: Face) -> bool:
    from shapely import Polygon

    across = np.argsort(np.abs(face.normal))[:2]
    return bool(Polygon(face.outline[:, across], [hole[:, across] for hole in face.holes]).is_valid)


def _free_radius(solid: Solid, wall: RoundFace) -> float:
    """How far the pieces are from the axis of a hole, where it is narrowest, [m]."""
    angle = 2.0 * np.pi * np.arange(_RAYS) / _RAYS
    x = wall.frame[:3, 0]
    y = wall.frame[:3, 1]
    out = np.outer(np.cos(angle), x) + np.outer(np.sin(angle), y)
    share = (0.5,) if wall.kind == "cylinder" else ((0.02,) if wall.radii[0] < wall.radii[1] else (0.98,))
    found = np.inf
    for s in share:
        at = wall.point + (wall.span[0] + s * wall.length) * wall.axis
        for piece in solid.pieces:
            planes = piece.planes if isinstance(piece, Hull) else None
            if planes is not None and np.abs(at - piece.center).max() < piece.half.max() + 2.0 * max(wall.radii):
                found = min(found, _nearest(planes, at, out))
    return float(found)


def _nearest(planes: Array, at: Array, out: Array) -> float:
    """Where rays from a point first enter a piece; infinite if none does."""
    rate = planes[:, :3] @ out.T
    room = (planes[:, 3] - planes[:, :3] @ at)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = room / rate
    enter = np.where(rate < -1e-12, cross, np.where((np.abs(rate) <= 1e-12) & (room < 0.0), np.inf, -np.inf)).max(
        axis=0
    )
    leave = np.where(rate > 1e-12, cross, np.inf).min(axis=0)
    hit = (enter < leave - 1e-9) & (leave > 0.0)
    return float(np.maximum(enter[hit], 0.0).min(initial=np.inf))
