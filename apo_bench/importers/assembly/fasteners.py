"""Recognise screws, nuts, washers and inserts: by their names, or by a shank that overlaps a hole as a thread does."""

import re
from collections.abc import Iterator, Sequence
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.importers.cad.solids import RawSolid, Region, convert_to_manifold

_NAME = re.compile(
    r"(?<![a-z])(screws?|setscrews?|bolts?|nuts?|washers?|schrauben?|muttern?|heat[ _-]?sets?|"
    r"(?:threaded|brass|heat[ _-]?set)[ _-]*inserts?|"
    r"(?:iso|din|ansi|asme|en)[ _-]?\d{2,5}|m\d+(?:[.,]\d+)?[ _-]?x[ _-]?\d+)(?![a-z])",
    re.IGNORECASE,
)
"""Names of fasteners, also by their standard or size."""
_LONGEST_MM = 120.0
"""A longer solid is no fastener, whatever its name."""
_LARGEST_SHARE = 0.25
"""A fastener has at most this share of the volume of the largest solid."""
_THREAD = (0.04, 0.3)
"""Depth of a thread: overlap of shank and hole, as a share of the radius of the shank."""
_HEAD = 1.2
"""A head is wider than its shank by at least this factor."""
_COAXIAL_MM = 0.1  # largest offset of the axes of a shank and its hole
_PARALLEL = 1e-3  # largest sine of the angle between them
_TOUCHES_MM = 0.15
"""A fastener holds the parts within this distance."""


_SCREW_HOLE_MM = (0.5, 4.5)  # least and largest radius of the hole of a screw
_BESIDE_MM = 0.5  # gap along the axis between the holes of one screw


class Fastener(NamedTuple):
    """A solid that fastens others."""

    raw: RawSolid
    why: str
    """How it was recognised, as a phrase."""


def find_fasteners(solids: Sequence[RawSolid]) -> dict[int, Fastener]:
    """Return the fasteners among the solids of an assembly by their index; none if fewer than two parts were left."""
    largest = max((raw.mesh.volume for raw in solids), default=0.0)
    found = {
        i: Fastener(raw, why)
        for i, raw in enumerate(solids)
        if raw.mesh.extent <= _LONGEST_MM
        and raw.mesh.volume <= _LARGEST_SHARE * largest
        and (why := _recognise(raw, [other for k, other in enumerate(solids) if k != i]))
    }
    parts = sum(len(raw.places) for i, raw in enumerate(solids) if i not in found)
    return found if parts > 1 else {}


def list_held_places(parts: Sequence[RawSolid], fasteners: Sequence[RawSolid]) -> set[tuple[int, int]]:
    """Return the copies of parts that a fastener touches, as index of the part and of its place."""
    bodies = [convert_to_manifold(each.mesh).transform(p.T[:3]) for each in fasteners for p in each.places]
    held = set[tuple[int, int]]()
    for i, raw in enumerate(parts):
        for k, place in enumerate(raw.places):
            own = convert_to_manifold(raw.mesh).transform(place.T[:3])
            if any(own.min_gap(body, 1.0) <= _TOUCHES_MM for body in bodies):
                held.add((i, k))
    return held


def list_places_with_screw_holes(parts: Sequence[RawSolid]) -> set[tuple[int, int]]:
    """Return the copies of parts whose narrow holes continue those of another copy, as index of the part and of its
    place: screws belong there, although they are not drawn."""
    copies = [(i, k) for i, raw in enumerate(parts) for k in range(len(raw.places))]
    holes = [[region for region in raw.regions if _is_screw_hole(region)] for raw in parts]
    found = set[tuple[int, int]]()
    for a, b in combinations(copies, 2):
        T = pose.inverse(parts[a[0]].places[a[1]].T) @ parts[b[0]].places[b[1]].T
        if any(_is_coaxial(one, other, T, _BESIDE_MM) for one, other in product(holes[a[0]], holes[b[0]])):
            found |= {a, b}
    return found


def _is_screw_hole(region: Region) -> bool:
    """Whether a round region is a hole as narrow as those of screws."""
    return region.kind == "cylinder" and region.hole and _SCREW_HOLE_MM[0] <= max(region.radii) <= _SCREW_HOLE_MM[1]


def _recognise(raw: RawSolid, others: Sequence[RawSolid]) -> str:
    """Return how a solid shows that it is a fastener; empty if it does not."""
    named = next((match[0] for name in (raw.name, *(p.name for p in raw.places)) if (match := _NAME.search(name))), "")
    if named:
        return f"'{named}' in its name"
    shanks = [region for region in raw.regions if region.kind == "cylinder" and region.is_whole and not region.hole]
    for shank in shanks:
        has_head = any(
            _is_coaxial(shank, other, np.eye(4)) and max(other.radii) > _HEAD * shank.radii[0] for other in shanks
        )
        if has_head and any(_list_threads(raw, shank, other) for other in others):
            return "its shank overlaps a hole as a thread does"
    return ""


def _list_threads(raw: RawSolid, shank: Region, other: RawSolid) -> list[Region]:
    """Return the holes of another solid that a shank overlaps by the depth of a thread."""
    holes = [region for region in other.regions if region.kind == "cylinder" and region.hole]
    return [
        hole
        for T in _list_relative_poses(raw, other)
        for hole in holes
        if _THREAD[0] <= 1.0 - hole.radii[0] / shank.radii[0] <= _THREAD[1] and _is_coaxial(shank, hole, T)
    ]


def _list_relative_poses(raw: RawSolid, other: RawSolid) -> Iterator[Array]:
    """Yield the pose of each copy of another solid in the frame of each copy of a solid, (4, 4), [mm]."""
    for own, its in product(raw.places, other.places):
        yield pose.inverse(own.T) @ its.T


def _is_coaxial(a: Region, b: Region, T: Array, beside_mm: float | None = None) -> bool:
    """Whether two round regions have one axis and meet along it.

    Args:
        T: (4, 4), pose of the solid of the second region in the frame of the first.
        beside_mm: Largest gap along the axis; None: the radius of the first.
    """
    ends = b.ends @ T[:3, :3].T + T[:3, 3] - a.point
    height = ends @ a.direction
    off = np.linalg.norm(ends - np.outer(height, a.direction), axis=1)
    is_parallel = abs(float(np.diff(height)[0])) > (1.0 - _PARALLEL) * float(np.linalg.norm(ends[1] - ends[0]))
    gap = max(height.min(), a.span[0]) - min(height.max(), a.span[1])
    meets = a is b or gap <= (max(a.radii) if beside_mm is None else beside_mm)
    return bool(off.max() < _COAXIAL_MM and is_parallel and meets)
