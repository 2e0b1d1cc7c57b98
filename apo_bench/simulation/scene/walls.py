"""Walls of holes apart from what is behind them, so that a part with a hole rests on few pieces instead of on all.

A hole is cut into many wedges, each of which may reach to the outside of the part. A part that lies on a table would
touch it with each of them, at four points. Here a wedge is cut in two: the wall, and what is behind it; the latter is
joined to few pieces, and the walls stand back behind the flat faces by less than a round wall is away from its circle.
Nothing else changes: the pieces make up the same part.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import (
    SAGITTA_M,
    Array,
    Hull,
    Piece,
    RoundFace,
    Solid,
    first_of_each,
    physical_pieces,
    remembered,
)

_THICK_M = 1e-3
"""How thick a wall is, or half as thick as the part is there."""
_SECTORS = 4
"""What is behind the walls of a hole becomes at least so many pieces."""
_ON_M = 1e-7
_PARALLEL = 1e-7
_THINNEST_M = 5e-5
_SAME_VOLUME = 1e-6


class _Wall(NamedTuple):
    """A wedge at a hole."""

    hull: Hull
    cut: Array
    """The plane (n, d) that ends the wall: n . x <= d is the wall."""


@remembered
def simulated_pieces(solid: Solid, clearance_m: float) -> Mapping[str, tuple[Piece, ...]]:
    """The pieces of a part as they are simulated, by the name of the piece that they are cut from.

    Remembered, since copies of a part, and the worlds of hands and of the arm, have the same.
    """
    pieces = physical_pieces(solid, clearance_m)
    if not any(face.hole and face.kind != "rim" for face in solid.rounds.values()):
        return {piece.name: (piece,) for piece in pieces}
    return _cut(solid, pieces, clearance_m)


def _cut(solid: Solid, pieces: tuple[Piece, ...], clearance_m: float) -> Mapping[str, tuple[Piece, ...]]:
    cut: dict[str, tuple[Piece, ...]] = {piece.name: (piece,) for piece in pieces}
    behind: list[Hull] = []
    walls: dict[str, Hull] = {}
    for face in solid.rounds.values():
        if face.hole and face.kind != "rim":
            whole = [piece for piece in pieces if piece.name not in walls]
            for group in _sectors(list(_walls(face, whole, clearance_m))):
                outer = [_beyond(wall) for wall in group]
                for wall, out in zip(group, outer, strict=True):
                    walls[wall.hull.name] = wall.hull if out is None else _within(wall.hull, wall.cut)
                behind += _joined([out for out in outer if out is not None])
    flats = [plane for plane in _flats(solid, clearance_m) if any(_has_side(hull, plane) for hull in behind)]
    for name, hull in walls.items():
        cut[name] = (_stood_back(hull, flats),)
    for hull in behind:
        cut[hull.name] += (Hull(f"{hull.name}_behind", hull.corners),)
    return cut


def _walls(face: RoundFace, pieces: Iterable[Piece], clearance_m: float) -> Iterator[_Wall]:
    """The wedges whose side is a wall of a hole, with where the wall ends."""
    # A wall of a cone of slope k has the normal (-u, k) / sqrt(1 + k^2) in (outwards, along the axis), and touches the
    # cone. The clearance moves it along its normal, so the radius by clearance / w.
    w = 1.0 / np.sqrt(1.0 + face.slope**2)
    radius = face.radii[0] - face.slope * face.span[0] + clearance_m * face.fit / w
    wedges = []
    for piece in pieces:
        if not isinstance(piece, Hull) or piece.cylinder is not None:
            continue
        n = piece.planes[:, :3]
        d = piece.planes[:, 3]
        on = np.abs(n @ face.axis - face.slope * w) < _PARALLEL
        on &= np.abs(n @ face.point - d - radius * w) < _ON_M
        if on.sum() == 1:
            wedges.append((piece, _sector(face, -n[on][0])))
    if not wedges:
        return
    reach = [float((hull.corners @ u).max() - face.point @ u) for hull, u in wedges]
    widest = max(face.radii) + clearance_m * face.fit
    for (hull, u), far in zip(wedges, reach, strict=True):
        thick = min(_THICK_M, (far - widest) / 2)
        if thick > _THINNEST_M:
            yield _Wall(hull, np.append(u, u @ face.point + widest + thick))


def _sector(face: RoundFace, outwards: Array) -> Array:
    """The middle direction of the sector around the axis in which a direction lies."""
    x = face.frame[:3, 0]
    y = face.frame[:3, 1]
    turn = 2.0 * np.pi / _SECTORS
    angle = turn * np.round(np.arctan2(outwards @ y, outwards @ x) / turn)
    return np.asarray(np.cos(angle) * x + np.sin(angle) * y)


def _sectors(walls: Sequence[_Wall]) -> Iterator[list[_Wall]]:
    """Walls with the same cut, neighbours next to each other."""
    left = list(walls)
    while left:
        first = left[0].cut
        group = [wall for wall in left if np.abs(wall.cut - first).max() < _ON_M]
        left = [wall for wall in left if np.abs(wall.cut - first).max() >= _ON_M]
        # in the order of their middles along the line that fits these best: the first right singular vector
        middle = np.array([wall.hull.corners.mean(axis=0) for wall in group])
        along = np.linalg.svd(middle - middle.mean(axis=0))[2][0]
        yield [group[i] for i in np.argsort(middle @ along)]


def _beyond(wall: _Wall) -> Hull | None:
    """What is behind a wall; None if that is thinner than anything is made."""
    n = wall.cut[:3]
    d = wall.cut[3]
    return _within(wall.hull, -wall.cut) if (wall.hull.corners @ n - d).max() > _THINNEST_M else None


def _within(hull: Hull, cut: Array) -> Hull:
    """What of a piece is on the inner side of a plane (n, d), n . x <= d, that goes through it."""
    # The corners below the plane, and where the lines from those to the corners above it cross it; the hull of all that
    # is the piece that was cut off, since lines through its inside end inside it.
    height = hull.corners @ cut[:3] - cut[3]
    low = hull.corners[height <= 0.0]
    high = hull.corners[height > 0.0]
    a = height[height <= 0.0]
    b = height[height > 0.0]
    part = a[:, None] / (a[:, None] - b)
    crossing = low[:, None] + part[..., None] * (high - low[:, None])
    return _hull_of(hull.name, np.concatenate([low, crossing.reshape(-1, 3)]))


def _hull_of(name: str, points: Array) -> Hull:
    """The piece around points, with its corners alone."""
    from scipy.spatial import ConvexHull

    # Qhull divides sides into triangles: of each plane one is kept, and a corner is where three of these meet.
    around = ConvexHull(points)
    sides = around.equations[first_of_each(around.equations[:, :3], signed=True)]
    corners = points[around.vertices]
    on = np.abs(corners @ sides[:, :3].T + sides[:, 3]) < 1e-9
    return Hull(name, corners[on.sum(axis=1) >= 3])


def _joined(pieces: list[Hull]) -> list[Hull]:
    """Neighbours as one piece where they make a convex one."""
    joined: list[Hull] = []
    filled = 0.0
    for piece in pieces:
        volume = _volume(piece)
        if joined:
            both = _hull_of(joined[-1].name, np.concatenate([joined[-1].corners, piece.corners]))
            whole = _volume(both)
            if abs(whole - filled - volume) < _SAME_VOLUME * whole:
                joined[-1] = both
                filled = whole
                continue
        joined.append(piece)
        filled = volume
    return joined


def _volume(hull: Hull) -> float:
    from scipy.spatial import ConvexHull

    return float(ConvexHull(hull.corners).volume)


def _flats(solid: Solid, clearance_m: float) -> list[Array]:
    """The planes (n, d) of the flat faces as they are made."""
    return [np.append(f.normal, f.normal @ f.outline[0] - clearance_m * f.fit) for f in solid.faces.values()]


def _has_side(hull: Hull, plane: Array) -> bool:
    """Whether a side of a piece lies in a plane (n, d)."""
    along = hull.planes[:, :3] @ plane[:3] > 1.0 - _PARALLEL
    return bool((along & (np.abs(hull.planes[:, 3] - plane[3]) < _ON_M)).any())


def _stood_back(hull: Hull, flats: Iterable[Array]) -> Hull:
    """A piece whose sides in these planes have moved inwards by a hair."""
    for plane in flats:
        if _has_side(hull, plane):
            hull = _within(hull, plane - [0.0, 0.0, 0.0, SAGITTA_M])
    return hull
