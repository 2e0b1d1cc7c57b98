"""Meshes become closed solids that are the right way round: corners joined, shells told apart."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.cad.meshes.crossing import crossing
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
    exact = without_slivers(corners, index.ravel()[mesh.triangles])
    if _is_closed(exact):
        return exact, ()
    grid = max(_SAME_CORNER * mesh.extent, 1e-9)
    rounded, index = np.unique(np.round(mesh.corners / grid), axis=0, return_inverse=True)
    near = without_slivers(rounded * grid, index.ravel()[mesh.triangles])
    return (near, (f"corners within {grid:.1g} mm were joined",)) if _is_closed(near) else (exact, ())


def without_slivers(corners: Array, triangles: Any) -> Mesh:
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
        x, y, z = where
        raise InputError(
            f"{path}: the surface crosses itself at ({x:.4g}, {y:.4g}, {z:.4g}) mm; mend it where it was drawn."
        )


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
    turned_other = np.where(opposed, k + count, k)
    pairs = np.column_stack([np.append(i, i + count), np.append(other, turned_other)])
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
    solids = []
    for k, shell in enumerate(shells):
        # In an even number of others a shell is the outside of a solid; those just inside of it are its cavities.
        if len(around[k]) % 2 == 0:
            cavities = [m for m in range(count) if k in around[m] and len(around[m]) == len(around[k]) + 1]
            whole = [_facing(shell, True), *(_facing(shells[m], False) for m in cavities)]
            solids.append((put_together(whole), shell.volume < 0.0))
    return solids


def _facing(mesh: Mesh, outwards: bool) -> Mesh:
    return mesh if (mesh.volume > 0.0) == outwards else mesh.flipped()


def _contains(shell: Mesh, inner: Mesh) -> bool:
    """Whether a shell is around another one: the solid angle at corners of that is a whole one.

    At a corner on the surface, where solids touch, it is anything, so several are looked at.
    """
    low = shell.corners.min(axis=0)
    high = shell.corners.max(axis=0)
    if (inner.corners < low).any() or (inner.corners > high).any():
        return False
    return all(_is_inside(shell, point) for point in inner.corners[:: max(1, len(inner.corners) // _PROBES)])


def _is_inside(shell: Mesh, point: Array) -> bool:
    # Van Oosterom and Strackee 1983: a triangle a, b, c is seen under the solid angle w with tan(w / 2) =
    # a . (b x c) / (|a| |b| |c| + (a . b) |c| + (b . c) |a| + (c . a) |b|). From inside all of them add up to 4 pi.
    a, b, c = (shell.corners[shell.triangles[:, i]] - point for i in range(3))
    x, y, z = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    above = (a * np.cross(b, c)).sum(axis=1)
    below = x * y * z + (a * b).sum(axis=1) * z + (b * c).sum(axis=1) * x + (c * a).sum(axis=1) * y
    return bool(abs(np.arctan2(above, below).sum()) > np.pi)
