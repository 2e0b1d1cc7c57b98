"""Meshes become closed solids that are the right way round: corners joined, shells told apart, none crosses itself."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.cad.solids.raw_solid import Mesh, RawSolid, SolidPlace, connected, put_together
from apo_bench.errors import InputError
from apo_bench.geometry import Array

_SAME_CORNER = 1e-7
"""Corners are one within this part of the size."""
_MOST_SHELLS = 200
_PROBES = 12
INSIDE_OUT = "it was inside out, and was turned"


def closed_solids(path: Path, name: str, mesh: Mesh) -> Iterator[RawSolid]:
    """The solids of one mesh of a file.

    Raises:
        InputError: A shell is open, or crosses itself or another one.
    """
    mesh, mended = _joined(mesh)
    check_closed(path, mesh)
    turned = _alike(path, mesh)
    if turned is not mesh:
        mended = (*mended, "triangles that looked the other way than their neighbours were turned")
    check_uncrossed(path, turned)
    solids = _apart(path, turned)
    for i, (solid, flipped) in enumerate(solids, start=1):
        own_name = name if len(solids) == 1 else f"{name}_{i}"
        yield RawSolid(own_name, solid, (SolidPlace(own_name, np.eye(4)),), (*mended, *([INSIDE_OUT] * flipped)))


def _joined(mesh: Mesh) -> tuple[Mesh, tuple[str, ...]]:
    """With corners in one place as one, and without triangles that are none then."""
    corners, index = np.unique(mesh.corners, axis=0, return_inverse=True)
    exact = _without_slivers(corners, index.ravel()[mesh.triangles])
    if _is_closed(exact):
        return exact, ()
    grid = max(_SAME_CORNER * mesh.extent, 1e-9)
    rounded, index = np.unique(np.round(mesh.corners / grid), axis=0, return_inverse=True)
    near = _without_slivers(rounded * grid, index.ravel()[mesh.triangles])
    return (near, (f"corners within {grid:.1g} mm were joined",)) if _is_closed(near) else (exact, ())


def _without_slivers(corners: Array, triangles: Any) -> Mesh:
    """A mesh without triangles that have one corner twice."""
    return Mesh(corners, triangles[has_three(triangles)])


def has_three(triangles: Any) -> Any:
    """Which triangles, (t, 3), have three different corners."""
    a, b, c = triangles.T
    return (a != b) & (b != c) & (c != a)


def _triangles_of_edges(mesh: Mesh) -> Any:
    """How many triangles each edge has."""
    return np.unique(np.sort(mesh.sides, axis=1), axis=0, return_counts=True)[1]


def _is_closed(mesh: Mesh) -> bool:
    return bool(len(mesh.triangles)) and bool((_triangles_of_edges(mesh) == 2).all())


def check_closed(path: Path, mesh: Mesh) -> None:
    """Raise an `InputError` unless every edge has two triangles."""
    if len(mesh.triangles) < 4:
        raise InputError(f"{path}: the triangles make no solid; save the part as a closed mesh.")
    counts = _triangles_of_edges(mesh)
    if (counts == 1).any():
        raise InputError(
            f"{path}: the shell is open: {(counts == 1).sum():,} edges have a triangle on one side only; close it "
            "where it was drawn, and save it again."
        )
    if (counts != 2).any():
        raise InputError(
            f"{path}: {(counts != 2).sum():,} of its edges are beside more than two triangles: solids touch there, or "
            "a sheet ends; save each solid as a file of its own."
        )


def check_uncrossed(path: Path, mesh: Mesh, off: Array | None = None) -> None:
    """Raise an `InputError` if the surface crosses itself.

    Args:
        off: How far each triangle may be from the surface that it stands for, (t,), [mm].
    """
    where = crossing(mesh, off)
    if where is not None:
        at = ", ".join(f"{x:.4g}" for x in where)
        raise InputError(f"{path}: the surface crosses itself at ({at}) mm; mend it where it was drawn.")


def _alike(path: Path, mesh: Mesh) -> Mesh:
    """With neighbours that look the same way, as the first triangle of each shell does."""
    i, k = mesh.neighbours.T
    count = len(mesh.triangles)
    # Two neighbours look the same way if they go through their edge in opposite directions.
    opposed = (mesh.sides[mesh.twins[:, 0]] == mesh.sides[mesh.twins[:, 1], ::-1]).all(axis=1)
    if opposed.all():
        return mesh
    # Each triangle twice, as it is (t) and turned (t + count): what looks the same way hangs together. A shell is two
    # groups then, one the other one turned; they are one group if the surface has one side only.
    other = np.where(opposed, k, k + count)
    pairs = np.column_stack([np.append(i, i + count), np.append(other, np.where(opposed, k + count, k))])
    _, group = connected(pairs, 2 * count)
    as_is, turned = group.reshape(2, count)
    if (as_is == turned).any():
        raise InputError(f"{path}: the surface has one side only; mend it where it was drawn.")
    # Groups are numbered by their first member, so the group that holds the first triangle as it is comes first.
    return Mesh(mesh.corners, np.where((as_is < turned)[:, None], mesh.triangles, mesh.triangles[:, ::-1]))


def _apart(path: Path, mesh: Mesh) -> list[tuple[Mesh, bool]]:
    """Its solids, with their cavities, in the order of the file; whether each was inside out."""
    count, owner = connected(mesh.neighbours, len(mesh.triangles))
    if count > _MOST_SHELLS:
        raise InputError(f"{path}: the file holds {count} shells; {_MOST_SHELLS} are the most, so split it.")
    shells = [mesh.part(np.flatnonzero(owner == shell)) for shell in range(count)]
    around = [{i for i, outer in enumerate(shells) if i != k and _contains(outer, shells[k])} for k in range(count)]
    # In an even number of others a shell is the outside of a solid, and looks outwards; those just inside of it are its
    # cavities, in an odd number.
    right = [s if (s.volume > 0.0) == (len(of) % 2 == 0) else s.flipped() for s, of in zip(shells, around, strict=True)]
    solids = []
    for k in (k for k in range(count) if len(around[k]) % 2 == 0):
        cavities = [right[m] for m in range(count) if k in around[m] and len(around[m]) == len(around[k]) + 1]
        solids.append((put_together([right[k], *cavities]), shells[k].volume < 0.0))
    return solids


def _contains(shell: Mesh, inner: Mesh) -> bool:
    """Whether a shell is around another one: the solid angle at corners of that is a whole one.

    At a corner on the surface, where solids touch, it is anything, so several are looked at.
    """
    beside = (inner.corners < shell.corners.min(axis=0)) | (inner.corners > shell.corners.max(axis=0))
    probes = inner.corners[:: max(1, len(inner.corners) // _PROBES)]
    return not beside.any() and all(_is_inside(shell, point) for point in probes)


def _is_inside(shell: Mesh, point: Array) -> bool:
    # Van Oosterom and Strackee 1983: a triangle a, b, c is seen under the solid angle w with tan(w / 2) =
    # a . (b x c) / (|a| |b| |c| + (a . b) |c| + (b . c) |a| + (c . a) |b|). From inside all of them add up to 4 pi.
    a, b, c = (shell.corners[shell.triangles[:, i]] - point for i in range(3))
    x, y, z = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    above = (a * np.cross(b, c)).sum(axis=1)
    below = x * y * z + (a * b).sum(axis=1) * z + (b * c).sum(axis=1) * x + (c * a).sum(axis=1) * y
    return bool(abs(np.arctan2(above, below).sum()) > np.pi)


_AT_ONCE = 200_000
_OF_TWO = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
_INSIDE = 1e-6
"""Crossings nearer to an edge than this part of a triangle are touches."""


def crossing(mesh: Mesh, off: Array | None = None) -> Array | None:
    """A point, (3,), at which two triangles without a common corner cross; None if none do.

    Args:
        off: How far each triangle may be from the surface that it stands for, (t,): triangles that cross by no more
            than that of both say nothing of the surfaces.
    """
    tolerance = 1e-6 * mesh.extent
    for pairs in _near(mesh):
        a, b = mesh.triangles[pairs.T]
        apart = (a[:, :, None] != b[:, None, :]).all(axis=(1, 2))
        least = np.full(int(apart.sum()), tolerance) + (0.0 if off is None else off[pairs[apart]].sum(axis=1))
        for edges, sheets in ((a[apart], b[apart]), (b[apart], a[apart])):
            where = _through(mesh.corners[edges], mesh.corners[sheets], least)
            if where is not None:
                return where
    return None


def _near(mesh: Mesh) -> Iterator[Any]:
    """Pairs of triangles whose boxes overlap, (p, 2), some at a time."""
    from scipy.spatial import cKDTree

    points = mesh.corners[mesh.triangles]
    low = points.min(axis=1)
    high = points.max(axis=1)
    order = cKDTree((low + high) / 2.0, leafsize=1).indices  # that keeps neighbours together
    # A box is its lowest corner and minus its highest one, (6,), so the box around two boxes is their minimum.
    levels = int(np.ceil(np.log2(max(len(order), 2))))
    leaves = np.full((1 << levels, 6), np.inf)
    leaves[: len(order)] = np.hstack([low, -high])[order]
    tree = [leaves]
    for _ in range(levels):
        tree.append(np.minimum(tree[-1][::2], tree[-1][1::2]))
    # From the root down, each pair of boxes that overlap is opened into the four pairs of what is in them.
    open_pairs = [(levels, np.zeros((1, 2), dtype=np.int64))]
    while open_pairs:
        level, pairs = open_pairs.pop()
        if level == 0:
            yield order[pairs[pairs[:, 0] < pairs[:, 1]]]
            continue
        every = np.concatenate([2 * pairs + off for off in _OF_TWO])
        every = every[every[:, 0] <= every[:, 1]]
        i, k = tree[level - 1][every.T]
        every = every[((i[:, :3] <= -k[:, 3:]) & (k[:, :3] <= -i[:, 3:])).all(axis=1)]
        open_pairs += [(level - 1, every[first : first + _AT_ONCE]) for first in range(0, len(every), _AT_ONCE)]


def _through(a: Array, b: Array, tolerance: Array) -> Array | None:
    """Where an edge of a triangle goes through the inside of another one; both (p, 3, 3).

    Args:
        tolerance: What is nearer only touches, (p,).
    """
    # Heights of the corners of a over the plane of b; an edge goes through where they have different signs.
    n = np.cross(b[:, 1] - b[:, 0], b[:, 2] - b[:, 0])
    size = np.linalg.norm(n, axis=1)
    n = n / np.maximum(size, 1e-300)[:, None]
    height = ((a - b[:, :1]) * n[:, None]).sum(axis=2)
    above = height > tolerance[:, None]
    below = height < -tolerance[:, None]
    for i in range(3):
        k = (i + 1) % 3
        through = ((above[:, i] & below[:, k]) | (below[:, i] & above[:, k])) & (size > tolerance**2)
        if not through.any():
            continue
        start = a[through, i]
        share = height[through, i] / (height[through, i] - height[through, k])
        x = start + share[:, None] * (a[through, k] - start)
        # x is inside of b if it is left of each of its edges, seen against n: (edge x (x - corner)) . n is the length
        # of the edge times the distance from it.
        corners = b[through]
        edges = np.roll(corners, -1, axis=1) - corners
        left = (np.cross(edges, x[:, None] - corners) * n[through][:, None]).sum(axis=2)
        margin = tolerance[through][:, None] * np.linalg.norm(edges, axis=2)
        inside = (left > _INSIDE * size[through][:, None] + margin).all(axis=1)
        if inside.any():
            return np.asarray(x[inside][0])
    return None
