"""Mark faces of a part as fit, so that the clearance moves them into the part."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from apo_bench.errors import require_known
from apo_bench.geometry import Face, RoundFace, Solid, recede_pieces
from apo_bench.scenario.parts.face_checks import check_receding


def mark_fit_faces(solid: Solid, undersizes_mm: Mapping[str, float]) -> Solid:
    """Mark faces of a solid as fit, after moving each of them into the solid by its undersize.

    For example, an undersize of 0.05 mm per side makes a wall fit between two walls that are 0.1 mm too near to each
    other; the clearance then gives it play. Outlines of neighbouring faces are not changed.

    An undersize below 0 thickens a part that was drawn with play until it touches; the clearance restores the play.

    Args:
        undersizes_mm: Name of a face -> distance by which it moves into the solid, [mm].

    Raises:
        InputError: A face is unknown, is the side of a box together with another one, is a hole that cannot get wider,
            or nothing is left of a piece.
    """
    for face in undersizes_mm:
        require_known("face", face, (*solid.faces, *solid.rounds), place="fit")
    pieces = solid.pieces
    for depth_mm in sorted({*undersizes_mm.values()} - {0.0}):
        names = {name for name, by_mm in undersizes_mm.items() if by_mm == depth_mm}
        flats = {name: replace(face, fit=name in names) for name, face in solid.faces.items()}
        walls = {name: replace(face, fit=name in names) for name, face in solid.rounds.items()}
        pieces = recede_pieces(replace(solid, pieces=pieces, faces=flats, rounds=walls), 1e-3 * depth_mm)
    fitted = replace(
        solid,
        pieces=pieces,
        faces={name: _recede_flat(face, undersizes_mm.get(name)) for name, face in solid.faces.items()},
        rounds={name: _recede_wall(face, undersizes_mm.get(name)) for name, face in solid.rounds.items()},
    )
    check_receding(fitted, Path(solid.name))
    return fitted


def _recede_flat(face: Face, by_mm: float | None) -> Face:
    """The face moved into the part and marked as fit; unchanged if `by_mm` is None."""
    if by_mm is None:
        return face
    off = -1e-3 * by_mm * face.normal
    return replace(face, outline=face.outline + off, holes=tuple(hole + off for hole in face.holes), fit=True)


def _recede_wall(face: RoundFace, by_mm: float | None) -> RoundFace:
    """The wall moved into the part and marked as fit; unchanged if `by_mm` is None."""
    if by_mm is None:
        return face
    by_m = 1e-3 * by_mm * (1.0 if face.hole else -1.0)
    return replace(face, radii=(face.radii[0] + by_m, face.radii[1] + by_m), fit=True)
