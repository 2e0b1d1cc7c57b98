"""Recognise screws, nuts, washers and inserts: by their names, or by a shank that overlaps a hole as a thread does."""

import re
from collections.abc import Iterator, Sequence
from itertools import product
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


def _is_coaxial(a: Region, b: Region, T: Array) -> bool:
    """Whether two round regions have one axis and meet along it; T is the pose of the second one's solid."""
    ends = b.ends @ T[:3, :3].T + T[:3, 3] - a.point
    height = ends @ a.direction
    off = np.linalg.norm(ends - np.outer(height, a.direction), axis=1)
    is_parallel = abs(float(np.diff(height)[0])) > (1.0 - _PARALLEL) * float(np.linalg.norm(ends[1] - ends[0]))
    gap = max(height.min(), a.span[0]) - min(height.max(), a.span[1])
    return bool(off.max() < _COAXIAL_MM and is_parallel and gap <= max(a.radii))
