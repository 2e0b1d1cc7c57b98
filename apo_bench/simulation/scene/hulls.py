"""Cut convex pieces by planes, and join them where the union is convex again."""

from collections.abc import Iterable

import numpy as np

from apo_bench.geometry import Array, Hull, find_distinct_directions, remember

ON_M = 1e-7  # parallel planes at a smaller distance are equal
PARALLEL = 1e-7  # normals with a cosine above 1 - this are parallel
_SAME_VOLUME = 1e-6  # relative difference of volumes that are equal


def clip_hull(hull: Hull, cut: Array) -> Hull:
    """The piece on the inner side of a plane (n, d), n . x <= d, that intersects it."""
    # Corners of the result: those below the plane, and the intersections of the plane with all lines from corners below
    # to corners above. Such lines lie in the piece, so the hull of these points is the clipped piece.
    height = hull.corners @ cut[:3] - cut[3]
    low = hull.corners[height <= 0.0]
    high = hull.corners[height > 0.0]
    a = height[height <= 0.0]
    b = height[height > 0.0]
    part = a[:, None] / (a[:, None] - b)  # share of the line from a low to a high corner below the plane
    crossing = low[:, None] + part[..., None] * (high - low[:, None])
    return _hull_of(hull.name, np.concatenate([low, crossing.reshape(-1, 3)]))


def enclose(a: Hull, b: Hull) -> Hull:
    """The convex hull of two pieces, with the name of the first."""
    return _hull_of(a.name, np.concatenate([a.corners, b.corners]))


@remember
def volume(hull: Hull) -> float:
    """The volume of a piece, [m^3]."""
    from scipy.spatial import ConvexHull

    return float(ConvexHull(hull.corners).volume)


def join_neighbours(pieces: Iterable[Hull]) -> list[Hull]:
    """Join consecutive pieces whose union is convex."""
    found: list[Hull] = []
    for piece in pieces:
        both = _as_one(found[-1], piece) if found else None
        if both is None:
            found.append(piece)
        else:
            found[-1] = both
    return found


def join_convex(pieces: Iterable[Hull]) -> list[Hull]:
    """Join any two pieces whose union is convex, until none is left."""
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
    """The piece with its sides in the planes `flats`, (n, d) each, moved inwards by `by_m`."""
    for plane in flats:
        if has_side(hull, plane):
            hull = clip_hull(hull, plane - [0.0, 0.0, 0.0, by_m])
    return hull


def _as_one(a: Hull, b: Hull) -> Hull | None:
    """The union of two pieces if it is convex, else None."""
    both = enclose(a, b)
    whole = volume(both)
    return both if abs(whole - volume(a) - volume(b)) < _SAME_VOLUME * whole else None


def _beside(a: Hull, b: Hull) -> bool:
    """Whether two pieces touch at coplanar sides with opposite normals."""
    if (np.abs(a.center - b.center) > a.half + b.half + ON_M).any():
        return False
    n = a.planes[:, :3] @ b.planes[:, :3].T
    d = a.planes[:, 3][:, None] + b.planes[:, 3]  # 0 for coplanar sides with opposite normals
    return bool(((n < PARALLEL - 1.0) & (np.abs(d) < ON_M)).any())


def _hull_of(name: str, points: Array) -> Hull:
    """The convex hull of points, (k, 3), without points inside its sides and edges."""
    from scipy.spatial import ConvexHull, QhullError

    # Qhull divides sides into triangles: one per plane is kept, and a point on at least three planes is a corner.
    hull = ConvexHull(points)
    sides = hull.equations[find_distinct_directions(hull.equations[:, :3], signed=True)]
    corners = points[hull.vertices]
    on = np.abs(corners @ sides[:, :3].T + sides[:, 3]) < 1e-9
    kept = corners[on.sum(axis=1) >= 3]
    # Nearly parallel sides of a small piece may have been merged, which would lose corners: then all points are kept.
    try:
        is_whole = len(kept) == len(corners) or ConvexHull(kept).volume > (1.0 - _SAME_VOLUME) * hull.volume
    except (QhullError, ValueError):
        is_whole = False
    return Hull(name, kept if is_whole else corners)
