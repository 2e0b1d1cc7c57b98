"""Convex pieces cut by planes, and put together where they make a convex piece again."""

from collections.abc import Iterable

import numpy as np

from apo_bench.geometry import Array, Hull, find_distinct_directions, remember

ON_M = 1e-7  # planes that are nearer are one
PARALLEL = 1e-7  # if their normals differ by no more
_SAME_VOLUME = 1e-6


def clip_hull(hull: Hull, cut: Array) -> Hull:
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


def enclose(a: Hull, b: Hull) -> Hull:
    """The piece around two pieces, with the name of the first."""
    return _hull_of(a.name, np.concatenate([a.corners, b.corners]))


@remember
def volume(hull: Hull) -> float:
    """[m^3]."""
    from scipy.spatial import ConvexHull

    return float(ConvexHull(hull.corners).volume)


def join_neighbours(pieces: Iterable[Hull]) -> list[Hull]:
    """Neighbours as one piece where they make a convex one; only what comes one after the other is tried."""
    found: list[Hull] = []
    for piece in pieces:
        both = _as_one(found[-1], piece) if found else None
        if both is None:
            found.append(piece)
        else:
            found[-1] = both
    return found


def join_convex(pieces: Iterable[Hull]) -> list[Hull]:
    """Any two as one piece where they make a convex one."""
    left = list(pieces)
    done: list[Hull] = []
    while left:
        piece = left.pop()
        for pool in (left, done):
            for i, other in enumerate(pool):
                both = _as_one(other, piece) if _beside(other, piece) else None
                if both is not None:
                    del pool[i]
                    left.append(both)
                    break
            else:
                continue
            break
        else:
            done.append(piece)
    return done


def has_side(hull: Hull, plane: Array) -> bool:
    """Whether a side of a piece lies in a plane (n, d)."""
    along = hull.planes[:, :3] @ plane[:3] > 1.0 - PARALLEL
    return bool((along & (np.abs(hull.planes[:, 3] - plane[3]) < ON_M)).any())


def set_back(hull: Hull, flats: Iterable[Array], by_m: float) -> Hull:
    """A piece whose sides in these planes have moved inwards."""
    for plane in flats:
        if has_side(hull, plane):
            hull = clip_hull(hull, plane - [0.0, 0.0, 0.0, by_m])
    return hull


def _as_one(a: Hull, b: Hull) -> Hull | None:
    both = enclose(a, b)
    whole = volume(both)
    return both if abs(whole - volume(a) - volume(b)) < _SAME_VOLUME * whole else None


def _beside(a: Hull, b: Hull) -> bool:
    """Whether a side of one is in the plane of a side of the other, looks the other way, and is near."""
    if (np.abs(a.center - b.center) > a.half + b.half + ON_M).any():
        return False
    n = a.planes[:, :3] @ b.planes[:, :3].T
    d = a.planes[:, 3][:, None] + b.planes[:, 3]
    return bool(((n < PARALLEL - 1.0) & (np.abs(d) < ON_M)).any())


def _hull_of(name: str, points: Array) -> Hull:
    """The piece around points, with its corners alone."""
    from scipy.spatial import ConvexHull, QhullError

    # Qhull divides sides into triangles: of each plane one is kept, and a corner is where three of these meet.
    hull = ConvexHull(points)
    sides = hull.equations[find_distinct_directions(hull.equations[:, :3], signed=True)]
    corners = points[hull.vertices]
    on = np.abs(corners @ sides[:, :3].T + sides[:, 3]) < 1e-9
    kept = corners[on.sum(axis=1) >= 3]
    # Of a small piece sides that hardly differ may be more than one, and corners of it more than these.
    try:
        is_whole = len(kept) == len(corners) or ConvexHull(kept).volume > (1.0 - _SAME_VOLUME) * hull.volume
    except (QhullError, ValueError):
        is_whole = False
    return Hull(name, kept if is_whole else corners)
