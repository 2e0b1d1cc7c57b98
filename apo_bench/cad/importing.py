"""A CAD file becomes part files: raw solids, names, pieces, faces that can make contacts, and what is said of it."""

import os
import re
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, final

import numpy as np

from apo_bench.cad.drawn_anew import faces_of
from apo_bench.cad.faces.facets import FEWEST_SIDES
from apo_bench.cad.from_regions import contact_faces, moments_of_pieces, solid_moments
from apo_bench.cad.meshes.crossings import uncrossed
from apo_bench.cad.meshes.mesh_file import CadFile, read_meshes
from apo_bench.cad.meshes.shells import CROSSED_A_LITTLE, ROUGH_MM, check_uncrossed, closed_solids
from apo_bench.cad.pieces.cutting import Cut, cut
from apo_bench.cad.solids.drawn import keep_drawn
from apo_bench.cad.solids.naming import title_of, with_names
from apo_bench.cad.solids.raw_solid import RawSolid, without_copies
from apo_bench.cad.step.step_file import STEP_SUFFIXES, read_step
from apo_bench.cad.time_limit import limit_of, time_limit
from apo_bench.errors import InputError
from apo_bench.geometry import Array, Face, Hull, RoundFace, Solid, passage
from apo_bench.parts import load_part
from apo_bench.parts.agreement import check_faces, supported
from apo_bench.parts.allowed import HEAVIEST_KG, LIGHTEST_KG, MOST_CORNERS_IN_ALL, MOST_FACES
from apo_bench.parts.making import Body, solid_of, write_part

_CUTTING = 3.0
"""Of the time for reading a file so much may go to cutting each of its solids."""
_BYTES = 50
"""Of a triangle in an STL file; in others it has more."""
_RAYS = 720
_LEAST_SHARE = 0.5
_NEARLY_ALL = 0.98
"""So much of a flat face must lie on the pieces: where these stand for free shapes, and elsewhere."""
_SLIVERS = 0.01
"""What is left out of pieces as too thin may be so much of the part; then the part has the volume of its pieces."""
_MATTER = re.compile(r"\S+, (volume_mm3|centroid_mm|inertia_mm5): ")
_FILLED = (
    "the hole is filled: with all of its round holes the part would take too many convex pieces, and nothing that the "
    "file has comes into this one, or it is one of the smallest"
)


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
    limit_s = limit_of(path.stat().st_size / _BYTES if path.is_file() else 0)
    with time_limit(f"{path}: finding the faces", "save it with fewer triangles", limit_s):
        if path.suffix.lower() in STEP_SUFFIXES:
            return read_step(path, unit)
        file, meshes = read_meshes(path, unit)
        solids = without_copies(raw for name, mesh in meshes for raw in closed_solids(path, name, mesh))
        return file, [_with_faces(path, raw, fewest_sides) for raw in solids]


def _with_faces(path: Path, raw: RawSolid, fewest_sides: int) -> RawSolid:
    faces = faces_of(raw.mesh, fewest_sides)
    if CROSSED_A_LITTLE in raw.mended and faces.mesh is raw.mesh:
        moved = uncrossed(raw.mesh, ROUGH_MM)
        check_uncrossed(path, moved)
        far = np.linalg.norm(moved.corners - raw.mesh.corners, axis=1).max()
        said = f"corners were moved by up to {far:.2g} mm where the surface crossed itself"
        faces = faces._replace(mesh=moved, said=(*faces.said, said))
        raw = replace(raw, mended=tuple(each for each in raw.mended if each != CROSSED_A_LITTLE))
    regions = with_names(faces.mesh, faces.regions)
    return replace(raw, mesh=faces.mesh, regions=regions, facets=faces.facets, mended=(*raw.mended, *faces.said))


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
    with time_limit(
        f"{source}: cutting the part into convex pieces",
        "leave out small holes, fillets and free surfaces",
        _CUTTING * limit_of(len(raw.mesh.triangles)),
    ):
        weight = 1e-9 * density * raw.mesh.volume
        if not LIGHTEST_KG <= weight <= HEAVIEST_KG:
            raise InputError(
                f"{source}: the part weighs {1e3 * weight:.3g} g at {density:g} kg/m^3; {1e3 * LIGHTEST_KG:g} g to "
                f"{HEAVIEST_KG / 1e3:g} t are allowed, so give another --density, or scale the part."
            )
        flats, rounds, refused = contact_faces(raw)
        _check_touches(source, flats, rounds)
        try:
            pieces = cut(raw, others, mates)
        except InputError as error:
            raise InputError(f"{source}: {error}") from error
        corners = sum(len(piece.corners) for piece in pieces.pieces)
        if corners > MOST_CORNERS_IN_ALL:
            raise InputError(
                f"{source}: the convex pieces of the part have {corners:,} corners; {MOST_CORNERS_IN_ALL:,} are the "
                "most, so leave out small holes and fillets."
            )
        _check_volume(source, raw, pieces)
        refused |= dict.fromkeys(pieces.filled, _FILLED)
        rounds = [wall for wall in rounds if wall.name not in refused]
        if len(flats) + len(rounds) > MOST_FACES:
            raise InputError(f"{source}: the part has {len(flats) + len(rounds)} faces; {MOST_FACES} are the most.")
        body = Body(pieces.pieces, tuple(flats), tuple(rounds), solid_moments(raw, pieces))
        solid = solid_of(name, body)
        shares: dict[str, float] = {}
        faces: list[Face | RoundFace] = [*flats, *rounds]
        for i, face in enumerate(faces):
            reason = _why_not(solid, face)
            # A flat face is stated as far as pieces hold it: some stand for free shapes, and slivers are left out.
            less = supported(face, solid.pieces) if reason and isinstance(face, Face) else None
            if (
                less is not None
                and less[1] > (_LEAST_SHARE if pieces.hulls else _NEARLY_ALL)
                and not _why_not(solid, less[0])
            ):
                flats[i], shares[face.name] = less
            elif reason:
                refused[face.name] = reason
        body = _without(replace(body, flats=tuple(flats)), refused)
        _check_touches(source, body.flats, body.rounds)
        color: dict[str, Any] = {"color": raw.places[0].color} if raw.places[0].color else {}
        title = title_of(raw.name) if raw.name != name else ""

        def write(body: Body) -> Path:
            return write_part(
                name, body, folder, density=density, source=source, licence="as that file", title=title, **color
            )

        path, solid = _as_read(write, body, refused, source)
        keep_drawn(raw.mesh, path)
        free = {wall.name: 1e3 * _free_radius(solid, wall) for wall in solid.rounds.values() if wall.hole}
        return Imported(path, raw, solid, pieces, refused, shares, free)


def _check_volume(source: str, raw: RawSolid, pieces: Cut) -> None:
    """Raise an `InputError` if pieces of a solid with flat faces only do not fill the volume that the file has."""
    if any(region.kind != "plane" for region in raw.regions):
        return
    filled = moments_of_pieces(pieces.pieces).size * 1e9
    if abs(filled - raw.mesh.volume) > _SLIVERS * raw.mesh.volume:
        raise InputError(
            f"{source}: the file has {raw.mesh.volume:.6g} mm^3, and the convex pieces of the part {filled:.6g} mm^3; "
            "save the part again from where it was drawn, or as STEP."
        )


def _check_touches(source: str, flats: Sequence[Face], rounds: Sequence[RoundFace]) -> None:
    if not (flats or rounds):
        raise InputError(
            f"{source}: no face of the part is flat or round, so it could touch nothing; draw one that is."
        )


def _without(body: Body, names: Container[str]) -> Body:
    """A body without some of its faces."""
    return replace(
        body,
        flats=tuple(face for face in body.flats if face.name not in names),
        rounds=tuple(face for face in body.rounds if face.name not in names),
    )


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
            own = moments_of_pieces(body.pieces) if _MATTER.match(why) else body.moments
            if 0.0 < abs(own.size - body.moments.size) < _SLIVERS * own.size:
                body = replace(body, moments=own)
                continue
            if face is None or face[1] not in left or len(left) == 1:
                raise InputError(
                    f"{source}: the import fails, by no fault of the file: the pieces that it cuts the solid into "
                    f"make no part ({why.split('; ')[0].rstrip('.')}); leave out fillets and free surfaces."
                ) from error
            refused[face[1]] = face[2]
            body = _without(body, refused)


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
