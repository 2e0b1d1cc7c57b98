"""Closed meshes become solids that are the right way round: shells told apart, those that cross united."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.importers.cad.meshes.joining import SAME_CORNER, join_corners
from apo_bench.importers.cad.solids.bodies import body_of, mesh_of, simplify
from apo_bench.importers.cad.solids.raw_solid import Mesh, RawSolid, SolidPlace, connected, put_together

_MOST_SHELLS = 200
_THINNEST = 1e-6
"""Volume over twice the area, in parts of the size: what is thinner is a sheet."""
_OPPOSED = 1e-9
"""Normals of neighbours are opposite to each other within this much of a cosine."""
_NARROWEST = 1e-3
"""Triangles of less height, in parts of the size of the solid, are noise."""
_COMMON = 1e-6
"""Solids that have less than this part of the smaller one in common only touch."""
_FEWER = 0.9
"""Corners in flat pieces are left out if so many triangles or less are left then."""
INSIDE_OUT = "it was inside out, and was turned"


def closed_solids(path: Path, name: str, mesh: Mesh) -> Iterator[RawSolid]:
    """The solids of one mesh of a file.

    Raises:
        InputError: A shell is open, or its triangles lie on each other.
    """
    joined, _ = join_corners(mesh, SAME_CORNER * mesh.extent)
    found = [shell for run in _runs(joined) for shell in _shells(path, run)]
    require(found, f"{path}: the triangles make no solid; save the part as a closed mesh.")
    require(len(found) <= _MOST_SHELLS, f"{path}: the file holds {len(found)} shells; {_MOST_SHELLS} are the most.")
    mended = (INSIDE_OUT,) if sum(shell.volume for shell in found) < 0.0 else ()
    shells = _unite([shell if shell.volume > 0.0 else shell.flipped() for shell in found])
    if len(shells) < len(found):
        mended = (*mended, f"{len(found)} closed shells, some of which go through each other, became {len(shells)}")
    solids = _with_cavities(shells)
    for i, solid in enumerate(solids, start=1):
        _check_unfolded(path, solid)
        own_name = name if len(solids) == 1 else f"{name}_{i}"
        fewer = simplify(solid)
        plain = fewer if len(fewer.triangles) < _FEWER * len(solid.triangles) else solid
        yield RawSolid(own_name, plain, (SolidPlace(own_name, np.eye(4)),), mended)


def _runs(mesh: Mesh) -> Iterator[Mesh]:
    """Parts of a mesh that are closed as they follow each other in the file: so solids that touch stay two."""
    begin = 0
    open_sides = set[tuple[int, int]]()
    for k, (a, b, c) in enumerate(mesh.triangles.tolist(), start=1):
        for start, end in ((a, b), (b, c), (c, a)):
            if (end, start) in open_sides:
                open_sides.remove((end, start))
            else:
                open_sides.add((start, end))
        if not open_sides:
            yield mesh.part(np.arange(begin, k))
            begin = k
    if begin < len(mesh.triangles):
        yield mesh.part(np.arange(begin, len(mesh.triangles)))


def _shells(path: Path, mesh: Mesh) -> list[Mesh]:
    """The connected surfaces of a mesh, but for sheets that have no room inside."""
    import manifold3d

    body = body_of(mesh)
    if body.status() != manifold3d.Error.NoError:
        check_closed(path, mesh)
    bodies = body.decompose()
    # One shell stays as the file has it, so that copies of a solid have their triangles in the same order.
    shells = [mesh] if len(bodies) == 1 and mesh.is_closed else [mesh_of(each) for each in bodies]
    return [
        each
        for each in shells
        if abs(each.volume) > _THINNEST * each.extent * np.linalg.norm(each.across, axis=1).sum()
    ]


def check_closed(path: Path, mesh: Mesh) -> None:
    """Raise an `InputError` unless every edge has two triangles that look the same way."""
    import manifold3d

    counts = np.unique(np.sort(mesh.sides, axis=1), axis=0, return_counts=True)[1]
    single, many = (counts == 1).sum(), (counts > 2).sum()
    require(not single, f"{path}: the shell is open: {single:,} edges have a triangle on one side only; close it.")
    require(not many, f"{path}: {many:,} edges are beside more than two triangles; save each solid on its own.")
    is_solid = body_of(mesh).status() == manifold3d.Error.NoError
    require(is_solid, f"{path}: neighbouring triangles look different ways; mend the solid where it was drawn.")


def _unite(shells: Sequence[Mesh]) -> list[Mesh]:
    """With shells that cross each other as one."""
    import manifold3d

    bodies = [body_of(shell) for shell in shells]
    common = _common(bodies)
    within = _within(common, bodies)
    least = np.minimum.outer(*[[body.volume() for body in bodies]] * 2)
    crossing = (common > _COMMON * least) & ~within & ~within.T
    count, group = connected(np.argwhere(crossing), len(shells))
    united = []
    for g in range(count):
        cluster = np.flatnonzero(group == g).tolist()
        if len(cluster) == 1:
            united.append(shells[cluster[0]])
        else:
            crossed = [bodies[k] for k in cluster]
            united.append(mesh_of(manifold3d.Manifold.batch_boolean(crossed, manifold3d.OpType.Add)))
    return united


def _common(bodies: Sequence[Any]) -> Array:
    """The volume that each two of some bodies have in common, (n, n)."""
    common = np.zeros((len(bodies), len(bodies)))
    for i, k in combinations(range(len(bodies)), 2):
        common[i, k] = common[k, i] = (bodies[i] ^ bodies[k]).volume()
    return common


def _within(common: Array, bodies: Sequence[Any]) -> Any:
    """Which bodies lie in which other ones, (n, n)."""
    sizes = np.array([body.volume() for body in bodies])
    return (common > (1.0 - _COMMON) * sizes[:, None]) & (sizes[:, None] < sizes)


def _with_cavities(shells: Sequence[Mesh]) -> list[Mesh]:
    """The solids that shells bound: in an even number of others one is the outside, in an odd number a cavity."""
    bodies = [body_of(shell) for shell in shells]
    within = _within(_common(bodies), bodies)
    depth = within.sum(axis=1)
    solids = []
    for k in np.flatnonzero(depth % 2 == 0).tolist():
        cavities = np.flatnonzero(within[:, k] & (depth == depth[k] + 1)).tolist()
        solids.append(put_together([shells[k], *(shells[m].flipped() for m in cavities)]))
    return solids


def _check_unfolded(path: Path, mesh: Mesh) -> None:
    """Raise an `InputError` if two neighbours lie on each other: a concave face that was cut into a fan does so."""
    i, k = mesh.neighbours.T
    size = np.linalg.norm(mesh.across, axis=1)
    length = np.linalg.norm(mesh.corners[mesh.edges[:, 0]] - mesh.corners[mesh.edges[:, 1]], axis=1)
    opposed = (mesh.across[i] * mesh.across[k]).sum(axis=1) < (_OPPOSED - 1.0) * size[i] * size[k]
    folded = opposed & (np.minimum(size[i], size[k]) > _NARROWEST * mesh.extent * length)
    if folded.any():
        at = ", ".join(f"{x:.4g}" for x in mesh.corners[mesh.edges[folded][0]].mean(axis=0))
        raise InputError(
            f"{path}: the surface folds back onto itself at ({at}) mm, as where a concave face was cut into a fan of "
            "triangles; save the part again from where it was drawn, or as STEP."
        )
