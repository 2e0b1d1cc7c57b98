"""Bands of tori, spheres and free surfaces, which look like cylinders and cones one by one."""

from typing import Any, NamedTuple

import numpy as np

from apo_bench.cad.facets import Facets
from apo_bench.cad.growing import FoundWall
from apo_bench.cad.raw import Mesh
from apo_bench.geometry.round_face import WHOLE_TURN

_BAND = 3.0
"""Bands of one free surface differ by less than this in how wide they are and how they bend."""
_GAP = 1.8
"""A turn is whole if no gap in it is this much wider than a strip."""


class _End(NamedTuple):
    """What a round surface goes over into smoothly at one of its ends."""

    beyond: frozenset[int]
    """Other round surfaces; -1 is anything else."""
    angle: float
    width: float
    """Of what is beyond it, across."""


def without_bands(mesh: Mesh, facets: Facets, rounds: list[FoundWall], count: int) -> list[FoundWall]:
    """Without bands of tori, spheres and free surfaces, which go over into others like them at both ends."""
    of = np.full(count, -1)
    for k, each in enumerate(rounds):
        of[each.members] = k
    dropped: set[int] = set()
    ends: list[list[_End]] = []
    widths: list[float] = []
    for k, each in enumerate(rounds):
        height, distance, _ = each.surface.polar(mesh.corners[_corners(facets, each.members)])
        widths.append(float(np.ptp(height)) * float(np.hypot(1.0, each.surface.slope)))
        ends.append(_ends(mesh, facets, of, k, each, float(height.min() + height.max()) / 2.0))
        turn = turn_of(facets, each)
        if (turn < WHOLE_TURN and ends[k] and widths[k] < turn * float(distance.mean())) or (
            len(ends[k]) == 2 and all(_alike(end, ends[k][0].angle, widths[k]) for end in ends[k])
        ):
            dropped.add(k)
    more = True
    while more:
        more = False
        for k, found in enumerate(ends):
            if k not in dropped and any(end.beyond & dropped and _alike(end, end.angle, widths[k]) for end in found):
                dropped.add(k)
                more = True
    return [each for k, each in enumerate(rounds) if k not in dropped]


def _ends(mesh: Mesh, facets: Facets, of: Any, k: int, each: FoundWall, middle: float) -> list[_End]:
    """The ends of a round surface that are smooth."""
    mine = of[facets.smooth] == k
    rows = np.flatnonzero(mine.sum(axis=1) == 1)
    points = mesh.corners[facets.along[rows]]
    along = points[:, 1] - points[:, 0]
    across = np.abs(along @ each.surface.axis) < 0.5 * np.linalg.norm(along, axis=1)
    rows = rows[across]
    at = points[across].mean(axis=1)
    beyond = np.where(mine[rows, 0], facets.smooth[rows, 1], facets.smooth[rows, 0])
    width = 2.0 * np.linalg.norm(facets.centers[beyond] - at, axis=1)
    low = each.surface.polar(at)[0] < middle
    return [
        _End(frozenset(of[beyond[side]].tolist()), float(np.median(facets.angle[rows[side]])), np.median(width[side]))
        for side in (low, ~low)
        if side.any()
    ]


def _alike(end: _End, angle: float, width: float) -> bool:
    """Whether what is beyond an end bends as much, the same way, and is as wide."""
    return (
        end.angle * angle > 0.0
        and max(abs(end.angle), abs(angle)) < _BAND * min(abs(end.angle), abs(angle))
        and max(end.width, width) < _BAND * min(end.width, width)
    )


def _corners(facets: Facets, members: Any) -> Any:
    return np.unique(facets.corner[np.isin(facets.owner, members)])


def turn_of(facets: Facets, found: FoundWall) -> float:
    """How far around its axis a round face reaches."""
    axis = found.surface.axis
    x = np.eye(3)[int(np.abs(axis).argmin())]
    x = x - (x @ axis) * axis
    _, _, out = found.surface.polar(facets.centers[found.members])
    middle = np.arctan2(out @ np.cross(axis, x), out @ x)
    order = np.argsort(middle)
    gaps = np.diff(np.append(middle[order], middle[order[0]] + WHOLE_TURN))
    widest = float(gaps.max())
    step = float(found.spans.max())
    return WHOLE_TURN if widest < _GAP * step else WHOLE_TURN - widest + step
