"""Separate the walls of a hole from the material behind them, so that a part rests on few pieces.

A hole consists of many wedges, each of which may reach to the outside of the part. A part on a table would touch it
with every wedge, at four points each. So each wedge is cut into the wall and the material behind it, which is joined to
few pieces. Walls end slightly below the flat faces around the hole, by less than a round wall deviates from its circle,
so that what rests on such a face touches other pieces. Material behind the walls also ends there, where other pieces
form the face. Two neighbouring walls are joined if their common side, tangent to the circle in
the middle, is near enough to the circle at its ends. The hole nowhere becomes narrower.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import SAGITTA_M, Array, Hull, Piece, RoundFace, Solid, remember, shrink_pieces
from apo_bench.simulation.scene.hulls import (
    ON_M,
    PARALLEL,
    clip_hull,
    enclose,
    has_side,
    join_convex,
    join_neighbours,
    set_back,
    volume,
)

COARSE_M = 2.5e-5
"""Largest distance of a simulated wall from its circle, as much as hand and contact yield in a step of 1 ms."""
_THICK_M = 1e-3
"""Thickness of a wall; half of the material's thickness if that is less."""
_SECTORS = 4
"""Sectors around the axis of a hole; the material behind the walls becomes at least this many pieces."""
_THINNEST_M = 5e-5  # nothing thinner is made
_SMALLEST_M3 = 1e-12  # smaller pieces behind a wall are left out: MuJoCo takes no such mesh
_LOST = 0.05
"""Largest share of the volume that joining two walls may cut away."""


class _Wall(NamedTuple):
    """A wedge of a hole, and the plane that cuts it into the wall and the material behind."""

    hull: Hull
    face: RoundFace
    outwards: Array
    """Unit vector across the axis, from it to the middle of the wall, (3,)."""
    cut: Array
    """The plane (n, d) between wall and material behind: n . x <= d is the wall."""
    behind_m: float
    """Distance of the cut from the axis."""


@remember
def linings(solid: Solid, clearance_m: float) -> Mapping[str, float]:
    """Name of each wall with material behind it -> distance of that material from the axis of the hole, [m]."""
    walls = [wall for group in _groups(solid, clearance_m) for wall in group]
    return {wall.hull.name: wall.behind_m for wall in walls if _reaches_beyond(wall)}


@remember
def simulated_pieces(solid: Solid, clearance_m: float) -> Mapping[str, tuple[Piece, ...]]:
    """Name of each piece of a part -> the pieces that are simulated in its place; empty if none is left.

    Cached, since copies of a part and both worlds of a scene have the same pieces.
    """
    pieces = shrink_pieces(solid, clearance_m)
    nothing: Mapping[str, tuple[Piece, ...]] = {piece.name: () for piece in solid.pieces}
    if not any(face.hole and face.kind != "rim" for face in solid.rounds.values()):
        return {**nothing, **{piece.name: (piece,) for piece in pieces}}
    return {**nothing, **_cut(solid, pieces, clearance_m)}


def _cut(solid: Solid, pieces: tuple[Piece, ...], clearance_m: float) -> Mapping[str, tuple[Piece, ...]]:
    """`simulated_pieces` of a part with holes."""
    behind: list[Hull] = []
    walls: dict[str, Hull | None] = {}
    for group in _groups(solid, clearance_m):
        lining = [wall for wall in group if _reaches_beyond(wall)]
        walls |= {wall.hull.name: None if _reaches_beyond(wall) else wall.hull for wall in group}
        # joined walls; the second of two stays None
        walls |= {hull.name: hull for hull in _coarser(lining, clearance_m)}
        behind += join_neighbours(clip_hull(wall.hull, -wall.cut) for wall in lining)
    behind = join_convex(behind)
    others = [p for p in pieces if isinstance(p, Hull) and p.cylinder is None and p.name not in walls]
    flats = [plane for plane in _flats(solid, clearance_m) if any(has_side(hull, plane) for hull in behind)]
    # faces that other pieces carry, too
    carried = [plane for plane in flats if any(has_side(hull, plane) for hull in others)]
    cut: dict[str, tuple[Piece, ...]] = {piece.name: (piece,) for piece in pieces}
    for name, wall in walls.items():
        cut[name] = () if wall is None else (set_back(wall, flats, SAGITTA_M),)
    for hull in behind:
        back = set_back(Hull(f"{hull.name}_behind", hull.corners), carried, SAGITTA_M)
        cut[hull.name] += (back,) if volume(back) > _SMALLEST_M3 else ()
    return cut


@remember
def _groups(solid: Solid, clearance_m: float) -> list[list[_Wall]]:
    """The walls of all holes, grouped by equal cuts; each wedge is the wall of one hole only."""
    groups: list[list[_Wall]] = []
    left = list(shrink_pieces(solid, clearance_m))
    for face in solid.rounds.values():
        if face.hole and face.kind != "rim":
            walls = list(_walls(face, left, clearance_m))
            taken = {wall.hull.name for wall in walls}
            left = [piece for piece in left if piece.name not in taken]
            groups += _sectors(walls)
    return groups


def _walls(face: RoundFace, pieces: Iterable[Piece], clearance_m: float) -> Iterator[_Wall]:
    """The walls of one hole among the pieces: the wedges with a side on its surface."""
    wedges = []
    for piece in pieces:
        if not isinstance(piece, Hull) or piece.cylinder is not None:
            continue
        n = piece.planes[:, :3]
        # Per side of the piece: direction away from the axis, and the tangent plane of the hole there.
        across = n - (n @ face.axis)[:, None] * face.axis
        far = np.linalg.norm(across, axis=1)
        outwards = -across / np.maximum(far, PARALLEL)[:, None]
        tangent = _tangents(face, outwards, clearance_m)
        # Sides that are tangent to the hole: same slope along the axis, then same distance.
        on = (np.abs(n @ face.axis - tangent[:, :3] @ face.axis) < PARALLEL) & (far > PARALLEL)
        on &= np.abs(piece.planes[:, 3] - tangent[:, 3]) < ON_M
        # Exactly one side on the surface: a wedge of this hole.
        if on.sum() == 1:
            wedges.append((piece, outwards[on][0], _sector(face, outwards[on][0])))
    if not wedges:
        return
    widest = max(face.radii) + clearance_m * face.fit  # largest radius of the hole, with clearance
    for hull, outwards, u in wedges:
        out = (hull.corners - face.point) @ u
        thick = min(_THICK_M, (float(out.max()) - widest) / 2)  # at most half of the material behind the wall
        # A piece that lies only far beyond the wall is left whole, as beside a pocket with rounded corners.
        if thick > _THINNEST_M and out.min() < widest + thick:
            yield _Wall(hull, face, outwards, np.append(u, u @ face.point + widest + thick), widest + thick)


def _tangents(face: RoundFace, outwards: Array, clearance_m: float) -> Array:
    """Tangent planes (n, d) of a hole with its clearance, (k, 4), at directions across its axis, (k, 3)."""
    # A wall of a cone of slope k has the normal (-u, k) / sqrt(1 + k^2) in (outwards, along the axis), and touches the
    # cone. The clearance moves it along its normal, so the radius by clearance / w.
    w = 1.0 / np.sqrt(1.0 + face.slope**2)
    radius = face.radii[0] - face.slope * face.span[0] + clearance_m * face.fit / w
    n = w * (face.slope * face.axis - outwards)
    return np.column_stack([n, n @ face.point - radius * w])


def _coarser(lining: Sequence[_Wall], clearance_m: float) -> Iterator[Hull]:
    """Walls cut off from the material behind; neighbours are joined in pairs if near enough to the circle."""
    left = list(lining)
    while left:
        wall = left.pop(0)
        alone = clip_hull(wall.hull, wall.cut)
        both = _as_one(wall, left[0], alone, clearance_m) if left else None
        if both is not None:
            left.pop(0)
        yield alone if both is None else both


def _as_one(a: _Wall, b: _Wall, first: Hull, clearance_m: float) -> Hull | None:
    """Two neighbouring walls joined to one, tangent to the circle in the middle; None if too far from the circle.

    Args:
        first: Wall `a`, already cut off from the material behind.
    """
    widest = max(a.face.radii) + clearance_m * a.face.fit
    cos = float(a.outwards @ b.outwards)
    if widest * (1.0 / max(cos, 0.1) - 1.0) > COARSE_M:
        return None
    second = clip_hull(b.hull, b.cut)
    middle = (a.outwards + b.outwards) / np.linalg.norm(a.outwards + b.outwards)
    both = clip_hull(enclose(first, second), _tangents(a.face, middle[None], clearance_m)[0])
    apart = volume(first) + volume(second)
    return both if (1.0 - _LOST) * apart < volume(both) < apart else None


def _sector(face: RoundFace, outwards: Array) -> Array:
    """The middle direction, (3,), of the sector around the axis that contains `outwards`."""
    x = face.frame[:3, 0]  # directions across the axis of the face: x, y
    y = face.frame[:3, 1]
    turn = 2.0 * np.pi / _SECTORS
    angle = turn * np.round(np.arctan2(outwards @ y, outwards @ x) / turn)
    return np.asarray(np.cos(angle) * x + np.sin(angle) * y)


def _sectors(walls: Sequence[_Wall]) -> Iterator[list[_Wall]]:
    """Groups of walls with the same cut, each sorted so that neighbours are adjacent."""
    left = list(walls)
    while left:
        first = left[0].cut
        group = [wall for wall in left if np.abs(wall.cut - first).max() < ON_M]
        left = [wall for wall in left if np.abs(wall.cut - first).max() >= ON_M]
        # in the order of their middles along the line that fits these best: the first right singular vector
        middle = np.array([wall.hull.corners.mean(axis=0) for wall in group])
        along = np.linalg.svd(middle - middle.mean(axis=0))[2][0]
        yield [group[i] for i in np.argsort(middle @ along)]


def _reaches_beyond(wall: _Wall) -> bool:
    """Whether the material behind a wall is thick enough to become a piece."""
    return bool((wall.hull.corners @ wall.cut[:3] - wall.cut[3]).max() > _THINNEST_M)


def _flats(solid: Solid, clearance_m: float) -> list[Array]:
    """The planes (n, d) of the flat faces, with clearance."""
    return [np.append(f.normal, f.normal @ f.outline[0] - clearance_m * f.fit) for f in solid.faces.values()]
