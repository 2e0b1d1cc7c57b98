"""Turn closed meshes into solids: separate shells, orient them outwards, unite crossing ones, and assign cavities."""

from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path

import manifold3d
import numpy as np

from apo_bench.errors import require
from apo_bench.importers.cad.meshes.corner_merging import SAME_CORNER, merge_corners
from apo_bench.importers.cad.meshes.cracks import close_cracks
from apo_bench.importers.cad.solids import (
    Mesh,
    RawSolid,
    SolidPlace,
    concatenate_meshes,
    convert_to_manifold,
    convert_to_mesh,
    find_connected_groups,
    simplify_body,
)

_MOST_SHELLS = 200  # in one file
_THINNEST = 1e-6
"""A shell whose volume over twice its area is below this share of its size is a sheet, not a solid."""
_OPPOSED = 1e-9
"""Neighbours lie on each other if the cosine of their normals is within this of -1."""
_NARROWEST = 1e-3
"""Triangles with a smaller height, as a share of the size of the solid, are noise."""
_COMMON = 1e-6
"""Solids with a smaller common volume, as a share of the smaller one, only touch."""
_FEWER = 0.9
"""Simplify a mesh only if this share of its triangles or less remains."""
INSIDE_OUT = "it was inside out, and was turned"  # text of a repair


def split_into_solids(path: Path, name: str, mesh: Mesh) -> Iterator[RawSolid]:
    """Return the solids of one mesh of a file.

    Raises:
        InputError: A shell is open, or its triangles lie on each other.
    """
    joined = close_cracks(merge_corners(mesh, SAME_CORNER * mesh.extent)[0])
    found = [shell for run in _list_closed_runs(joined) for shell in _split_into_shells(path, run)]
    require(found, f"{path}: the triangles make no solid; save the part as a closed mesh.")
    require(len(found) <= _MOST_SHELLS, f"{path}: the file holds {len(found)} shells; {_MOST_SHELLS} are the most.")
    # A negative volume: normals point inwards.
    repairs = (INSIDE_OUT,) if sum(shell.volume for shell in found) < 0.0 else ()
    solids, count = _combine_shells([shell if shell.volume > 0.0 else shell.flip() for shell in found])
    if count < len(found):
        repairs = (*repairs, f"{len(found)} closed shells, some of which go through each other, became {count}")
    for solid in solids:
        _check_unfolded(path, solid)
        fewer = simplify_body(solid)
        plain = fewer if len(fewer.triangles) < _FEWER * len(solid.triangles) else solid
        yield RawSolid(name, plain, (SolidPlace(name, np.eye(4)),), repairs)


def _list_closed_runs(mesh: Mesh) -> Iterator[Mesh]:
    """Yield consecutive runs of triangles that are closed surfaces, so that solids that touch stay apart."""
    begin = 0
    open_sides = set[tuple[int, int]]()  # directed edges that still miss their opposite
    for k, (a, b, c) in enumerate(mesh.triangles.tolist(), start=1):
        for start, end in ((a, b), (b, c), (c, a)):
            if (end, start) in open_sides:
                open_sides.remove((end, start))
            else:
                open_sides.add((start, end))
        if not open_sides or k == len(mesh.triangles):
            yield mesh.part(np.arange(begin, k))
            begin = k


def _split_into_shells(path: Path, mesh: Mesh) -> list[Mesh]:
    """Return the connected surfaces of a mesh, without sheets that enclose no volume."""
    body = convert_to_manifold(mesh)
    if body.status() != manifold3d.Error.NoError:
        check_closed(path, mesh)
    bodies = body.decompose()
    # One shell stays as the file has it, so that copies of a solid have their triangles in the same order.
    shells = [mesh] if len(bodies) == 1 and mesh.is_closed else [convert_to_mesh(each) for each in bodies]
    return [
        each
        for each in shells
        if abs(each.volume) > _THINNEST * each.extent * np.linalg.norm(each.across, axis=1).sum()
    ]


def check_closed(path: Path, mesh: Mesh) -> None:
    """Raise InputError unless every edge has two triangles with consistent orientation."""
    counts = np.unique(np.sort(mesh.sides, axis=1), axis=0, return_counts=True)[1]
    single, many = (counts == 1).sum(), (counts > 2).sum()
    require(not single, f"{path}: the shell is open: {single:,} edges have a triangle on one side only; close it.")
    require(not many, f"{path}: {many:,} edges have more than two triangles; save each solid on its own.")
    is_solid = convert_to_manifold(mesh).status() == manifold3d.Error.NoError
    require(is_solid, f"{path}: neighbouring triangles face different ways; repair the solid in its CAD program.")


def _combine_shells(shells: Sequence[Mesh]) -> tuple[list[Mesh], int]:
    """Combine shells into solids: shells that cross are united, shells inside others are cavities.

    A shell inside an even number of others is an outer surface, inside an odd number a cavity.

    Returns:
        The solids with their cavities, and the number of shells after uniting.
    """
    bodies = [convert_to_manifold(shell) for shell in shells]
    sizes = np.array([body.volume() for body in bodies])
    common = np.zeros((len(bodies), len(bodies)))
    for i, k in combinations(range(len(bodies)), 2):
        common[i, k] = common[k, i] = (bodies[i] ^ bodies[k]).volume()
    is_within = (common > (1.0 - _COMMON) * sizes[:, None]) & (sizes[:, None] < sizes)  # shell i lies within shell k
    is_crossing = (common > _COMMON * np.minimum.outer(sizes, sizes)) & ~is_within & ~is_within.T
    if is_crossing.any():
        _, group = find_connected_groups(np.argwhere(is_crossing), len(shells))
        united = []
        for g in np.unique(group):
            members = np.flatnonzero(group == g).tolist()
            body = manifold3d.Manifold.batch_boolean([bodies[k] for k in members], manifold3d.OpType.Add)
            united.append(shells[members[0]] if len(members) == 1 else convert_to_mesh(body))
        return _combine_shells(united)  # united shells may be within others, so start over
    depth = is_within.sum(axis=1)
    solids = []
    for k in np.flatnonzero(depth % 2 == 0).tolist():  # outer surfaces
        # Cavities directly inside shell k.
        cavities = np.flatnonzero(is_within[:, k] & (depth == depth[k] + 1)).tolist()
        solids.append(concatenate_meshes([shells[k], *(shells[m].flip() for m in cavities)]))
    return solids, len(shells)


def _check_unfolded(path: Path, mesh: Mesh) -> None:
    """Raise InputError for two neighbouring triangles that lie on each other, as from a bad triangulation."""
    i, k = mesh.neighbours.T
    size = np.linalg.norm(mesh.across, axis=1)
    length = np.linalg.norm(mesh.corners[mesh.edges[:, 0]] - mesh.corners[mesh.edges[:, 1]], axis=1)
    opposed = (mesh.across[i] * mesh.across[k]).sum(axis=1) < (_OPPOSED - 1.0) * size[i] * size[k]
    folded = opposed & (np.minimum(size[i], size[k]) > _NARROWEST * mesh.extent * length)
    require(
        not folded.any(),
        f"{path}: the surface folds back onto itself, as where a concave face was cut into a fan of triangles; save "
        "the part again in its CAD program, or as STEP.",
    )
