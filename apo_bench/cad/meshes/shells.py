"""Closed meshes become solids that are the right way round: shells told apart, those that cross united."""

from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

import numpy as np

from apo_bench.cad.meshes.closing import closed, triangles_of_edges
from apo_bench.cad.meshes.crossings import crossings
from apo_bench.cad.solids.bodies import body_of, mesh_of
from apo_bench.cad.solids.raw_solid import Mesh, RawSolid, SolidPlace, connected, put_together
from apo_bench.errors import InputError
from apo_bench.geometry import Array

_MOST_SHELLS = 200
_PROBES = 12
_OPPOSED = 1e-9
"""Normals of neighbours are opposite to each other within this much of a cosine."""
_NARROWEST = 1e-3
"""Triangles of less height, in parts of the size of the solid, are noise."""
_THINNEST = 1e-6
"""Volume over twice the area, in parts of the size: what is thinner is a sheet."""
NO_SOLID = "the triangles make no solid; save the part as a closed mesh."
ROUGH_MM = 0.1
CROSSED_A_LITTLE = f"crossings of less than {ROUGH_MM:g} mm were taken as noise"
"""That is noise where the mesh is drawn anew; elsewhere corners are moved, or it is refused."""
INSIDE_OUT = "it was inside out, and was turned"


def closed_solids(path: Path, name: str, mesh: Mesh) -> Iterator[RawSolid]:
    """The solids of one mesh of a file.

    Raises:
        InputError: A shell is open, or crosses itself.
    """
    mesh, mended = closed(mesh)
    check_closed(path, mesh)
    turned = _alike(path, mesh)
    if turned is not mesh:
        mended = (*mended, "triangles that looked the other way than their neighbours were turned")
    whole, united = _united(path, turned)
    mended = (*mended, *united)
    solids = _apart(path, whole)
    for solid, _ in solids:
        _check_unfolded(path, solid)
    for i, (solid, flipped) in enumerate(solids, start=1):
        own_name = name if len(solids) == 1 else f"{name}_{i}"
        yield RawSolid(own_name, solid, (SolidPlace(own_name, np.eye(4)),), (*mended, *([INSIDE_OUT] * flipped)))


def check_closed(path: Path, mesh: Mesh) -> None:
    """Raise an `InputError` unless every edge has two triangles."""
    if len(mesh.triangles) < 4:
        raise InputError(f"{path}: {NO_SOLID}")
    counts = triangles_of_edges(mesh)
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
    for _, where in crossings(mesh, off):
        _refuse_crossing(path, where[0])


def _refuse_crossing(path: Path, where: Array) -> NoReturn:
    at = ", ".join(f"{x:.4g}" for x in where)
    raise InputError(f"{path}: the surface crosses itself at ({at}) mm; mend it where it was drawn.")


def _check_unfolded(path: Path, mesh: Mesh) -> None:
    """Raise an `InputError` if two neighbours lie on each other: a concave face that was cut into a fan does so."""
    i, k = mesh.neighbours.T
    size = np.linalg.norm(mesh.across, axis=1)
    length = np.linalg.norm(mesh.corners[mesh.edges[:, 0]] - mesh.corners[mesh.edges[:, 1]], axis=1)
    opposed = (mesh.across[i] * mesh.across[k]).sum(axis=1) < (_OPPOSED - 1.0) * size[i] * size[k]
    folded = opposed & (np.minimum(size[i], size[k]) > _NARROWEST * mesh.extent * length)
    if folded.any():
        at = mesh.corners[mesh.edges[folded][0]].mean(axis=0)
        raise InputError(
            f"{path}: the surface folds back onto itself at ({', '.join(f'{x:.4g}' for x in at)}) mm, as where a "
            "concave face was cut into a fan of triangles; save the part again from where it was drawn, or as STEP."
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
    pairs = np.column_stack([np.append(i, i + count), np.append(other, np.where(opposed, k + count, k))])
    _, group = connected(pairs, 2 * count)
    as_is, turned = group.reshape(2, count)
    if (as_is == turned).any():
        raise InputError(f"{path}: the surface has one side only; mend it where it was drawn.")
    # Groups are numbered by their first member, so the group that holds the first triangle as it is comes first.
    return Mesh(mesh.corners, np.where((as_is < turned)[:, None], mesh.triangles, mesh.triangles[:, ::-1]))


def _united(path: Path, mesh: Mesh) -> tuple[Mesh, tuple[str, ...]]:
    """With shells that cross each other as one; and what is said of that.

    Raises:
        InputError: A shell crosses itself, or looks outwards where the one that it crosses looks inwards.
    """
    import manifold3d

    if next(crossings(mesh), None) is None:
        return mesh, ()
    count, owner = connected(mesh.neighbours, len(mesh.triangles))
    for deep, at in crossings(mesh, np.full(len(mesh.triangles), ROUGH_MM / 2.0)):
        if (itself := owner[deep[:, 0]] == owner[deep[:, 1]]).any():
            _refuse_crossing(path, at[itself][0])
    found = [*crossings(mesh)]
    pairs = owner[np.concatenate([pair for pair, _ in found])]
    where = np.concatenate([at for _, at in found])
    sign = np.sign([mesh.part(np.flatnonzero(owner == shell)).volume for shell in range(count)])
    alone = pairs[:, 0] == pairs[:, 1]
    said = [CROSSED_A_LITTLE] if alone.any() else []
    ambiguous = sign[pairs[:, 0]] != sign[pairs[:, 1]]
    if ambiguous.any():
        _refuse_crossing(path, where[ambiguous][0])
    pairs = pairs[~alone]
    if not len(pairs):
        return mesh, tuple(said)
    _, cluster = connected(pairs, count)
    shells = []
    for group in np.unique(cluster):
        each = [mesh.part(np.flatnonzero(owner == shell)) for shell in np.flatnonzero(cluster == group)]
        if len(each) > 1:
            outwards = (shell if shell.volume > 0.0 else shell.flipped() for shell in each)
            each = [mesh_of(manifold3d.Manifold.batch_boolean([body_of(s) for s in outwards], manifold3d.OpType.Add))]
        shells += each
    crossed = len(np.unique(pairs))
    return put_together(shells), (*said, f"{crossed} closed shells that go through each other were united")


def _apart(path: Path, mesh: Mesh) -> list[tuple[Mesh, bool]]:
    """Its solids, with their cavities, in the order of the file; whether each was inside out."""
    count, owner = connected(mesh.neighbours, len(mesh.triangles))
    if count > _MOST_SHELLS:
        raise InputError(f"{path}: the file holds {count} shells; {_MOST_SHELLS} are the most, so split it.")
    shells = [mesh.part(np.flatnonzero(owner == shell)) for shell in range(count)]
    shells = [shell for shell in shells if _is_solid(shell)]
    if not shells:
        raise InputError(f"{path}: {NO_SOLID}")
    count = len(shells)
    around = [{i for i, outer in enumerate(shells) if i != k and _contains(outer, shells[k])} for k in range(count)]
    # In an even number of others a shell is the outside of a solid, and looks outwards; those just inside of it are its
    # cavities, in an odd number.
    right = [s if (s.volume > 0.0) == (len(of) % 2 == 0) else s.flipped() for s, of in zip(shells, around, strict=True)]
    solids = []
    for k in (k for k in range(count) if len(around[k]) % 2 == 0):
        cavities = [right[m] for m in range(count) if k in around[m] and len(around[m]) == len(around[k]) + 1]
        solids.append((put_together([right[k], *cavities]), shells[k].volume < 0.0))
    return solids


def _is_solid(shell: Mesh) -> bool:
    """Whether there is room inside: a sheet of two sides has none."""
    return abs(shell.volume) > _THINNEST * shell.extent * float(np.linalg.norm(shell.across, axis=1).sum())


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
