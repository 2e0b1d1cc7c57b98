"""Meshes become closed solids that are the right way round: corners joined, shells told apart, copies found."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from apo_bench.cad.crossing import crossing
from apo_bench.cad.raw import Mesh, Place
from apo_bench.cad.reading import Shape
from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array

_SAME = 1e-7
_COPY = 2e-6
"""Corners are one, and solids the same, within this part of their size."""
_MOST_SOLIDS = 200
_ASKED = 12


class Closed(NamedTuple):
    """A closed solid."""

    name: str
    mesh: Mesh
    places: tuple[Place, ...]
    said: tuple[str, ...]


def closed_solids(path: Path, shapes: tuple[Shape, ...]) -> list[Closed]:
    """The solids of a file, each of different shape once.

    Raises:
        InputError: A shell is open, or crosses itself or another one.
    """
    found: list[Closed] = []
    for shape in shapes:
        mesh, said = _joined(shape.mesh)
        check_closed(path, mesh)
        turned = _alike(path, mesh)
        if turned is not mesh:
            said = (*said, "triangles that looked the other way than their neighbours were turned")
        check_uncrossed(path, turned)
        solids = _apart(path, turned)
        for i, (solid, flipped) in enumerate(solids, start=1):
            name = shape.name if len(solids) == 1 else f"{shape.name}_{i}"
            more = ("it was inside out, and was turned",) if flipped else ()
            _add(found, Closed(name, solid, (Place(name, np.eye(4)),), (*said, *more)))
    return found


def _joined(mesh: Mesh) -> tuple[Mesh, tuple[str, ...]]:
    """With corners in one place as one, and without triangles that are none then."""
    corners, index = np.unique(mesh.corners, axis=0, return_inverse=True)
    exact = _kept(corners, index.ravel()[mesh.triangles])
    if _is_closed(exact):
        return exact, ()
    grid = max(_SAME * mesh.extent, 1e-9)
    rounded, index = np.unique(np.round(mesh.corners / grid), axis=0, return_inverse=True)
    near = _kept(rounded * grid, index.ravel()[mesh.triangles])
    return (near, (f"corners within {grid:.1g} mm were joined",)) if _is_closed(near) else (exact, ())


def _kept(corners: Array, triangles: Any) -> Mesh:
    a, b, c = triangles.T
    return Mesh(corners, triangles[(a != b) & (b != c) & (c != a)])


def _counts(mesh: Mesh) -> Any:
    _, counts = np.unique(np.sort(mesh.sides, axis=1), axis=0, return_counts=True)
    return counts


def _is_closed(mesh: Mesh) -> bool:
    return bool(len(mesh.triangles)) and bool((_counts(mesh) == 2).all())


def check_closed(path: Path, mesh: Mesh) -> None:
    """Raise an `InputError` unless every edge has two triangles."""
    if len(mesh.triangles) < 4:
        raise InputError(f"{path}: the triangles make no solid; save the part as a closed mesh.")
    counts = _counts(mesh)
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
    """With neighbours that look the same way."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import breadth_first_order, connected_components

    count = len(mesh.triangles)
    order = np.lexsort(np.sort(mesh.sides, axis=1).T).reshape(-1, 2)
    opposed = (mesh.sides[order[:, 0]] == mesh.sides[order[:, 1], ::-1]).all(axis=1)
    if opposed.all():
        return mesh
    pairs = order % count
    graph = coo_matrix((np.where(opposed, 1, 2), pairs.T), (count, count)).tocsr()
    graph = graph.maximum(graph.T)
    shells, owner = connected_components(graph, directed=False)
    sign = np.ones(count, dtype=np.int64)
    for shell in range(shells):
        way, before = breadth_first_order(graph, int(np.flatnonzero(owner == shell)[0]), directed=False)
        for t in way[1:]:
            sign[t] = sign[before[t]] * (1 if graph[t, before[t]] == 1 else -1)
    if (sign[pairs[:, 0]] * sign[pairs[:, 1]] != np.where(opposed, 1, -1)).any():
        raise InputError(f"{path}: the surface has one side only; mend it where it was drawn.")
    return Mesh(mesh.corners, np.where(sign[:, None] > 0, mesh.triangles, mesh.triangles[:, ::-1]))


def _apart(path: Path, mesh: Mesh) -> list[tuple[Mesh, bool]]:
    """Its solids, with their cavities, in the order of the file; whether each was inside out."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    count = len(mesh.triangles)
    pairs = mesh.neighbours
    count_shells, owner = connected_components(
        coo_matrix((np.ones(len(pairs)), pairs.T), (count, count)), directed=False
    )
    if count_shells > _MOST_SOLIDS:
        raise InputError(f"{path}: the file holds {count_shells} shells; {_MOST_SOLIDS} are the most, so split it.")
    shells = [mesh.part(np.flatnonzero(owner == shell)) for shell in range(count_shells)]
    inside = [
        [i for i, outer in enumerate(shells) if i != k and _contains(outer, shell)] for k, shell in enumerate(shells)
    ]
    found = []
    for k, shell in enumerate(shells):
        if len(inside[k]) % 2:
            continue
        flipped = shell.volume < 0.0
        whole = [_facing(shell, True)]
        for m, other in enumerate(shells):
            if k in inside[m] and len(inside[m]) == len(inside[k]) + 1:
                whole.append(_facing(other, False))
        offsets = np.cumsum([0, *(len(each.corners) for each in whole[:-1])])
        corners = np.concatenate([each.corners for each in whole])
        triangles = np.concatenate([each.triangles + n for each, n in zip(whole, offsets, strict=True)])
        found.append((Mesh(corners, triangles), flipped))
    return found


def _facing(mesh: Mesh, outwards: bool) -> Mesh:
    return mesh if (mesh.volume > 0.0) == outwards else Mesh(mesh.corners, mesh.triangles[:, ::-1])


def _contains(shell: Mesh, inner: Mesh) -> bool:
    """Whether a shell is around another one: the solid angle at corners of that is a whole one.

    At a corner on the surface, where solids touch, it is anything, so several are asked.
    """
    low = shell.corners.min(axis=0)
    high = shell.corners.max(axis=0)
    if (inner.corners < low).any() or (inner.corners > high).any():
        return False
    return all(_is_inside(shell, point) for point in inner.corners[:: max(1, len(inner.corners) // _ASKED)])


def _is_inside(shell: Mesh, point: Array) -> bool:
    a, b, c = (shell.corners[shell.triangles[:, i]] - point for i in range(3))
    x, y, z = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    above = (a * np.cross(b, c)).sum(axis=1)
    below = x * y * z + (a * b).sum(axis=1) * z + (b * c).sum(axis=1) * x + (c * a).sum(axis=1) * y
    return bool(abs(np.arctan2(above, below).sum()) > np.pi)


def _add(found: list[Closed], new: Closed) -> None:
    """Another solid, as a place of one that is the same, or on its own."""
    for i, old in enumerate(found):
        pose = moved_onto(old.mesh, new.mesh)
        if pose is not None:
            found[i] = old._replace(places=(*old.places, new.places[0]._replace(T=pose)))
            return
    found.append(new)


def moved_onto(a: Mesh, b: Mesh) -> Array | None:
    """How the first one is moved onto the second, which has the same triangles in the same order; else None."""
    if len(a.corners) != len(b.corners) or len(a.triangles) != len(b.triangles):
        return None
    if abs(a.volume - b.volume) > 1e-4 * abs(a.volume):
        return None
    p = a.corners[a.triangles].reshape(-1, 3)
    q = b.corners[b.triangles].reshape(-1, 3)
    P = p - p.mean(axis=0)
    Q = q - q.mean(axis=0)
    U, _, V = np.linalg.svd(P.T @ Q)
    R = V.T @ np.diag([1.0, 1.0, np.linalg.det(V.T @ U.T)]) @ U.T
    if np.abs(P @ R.T - Q).max() > _COPY * max(a.extent, float(np.abs(q).max())):
        return None
    R = np.where(np.abs(R) < 1e-7, 0.0, R)
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = q.mean(axis=0) - R @ p.mean(axis=0)
    return T
