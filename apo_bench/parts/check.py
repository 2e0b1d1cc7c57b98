"""A second opinion on a solid: the mesh that manifold3d makes of its pieces, measured by trimesh; one piece or more?"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import Box, Piece, Solid, face_area, separating_axes, shadow

_TOUCHING_M = 2e-5
"""Thinner layers of a solid may be left out between its pieces."""
_MOST_TESTS = 10_000
"""Pairs of pieces with boxes that overlap, of which it is not known yet that they belong together."""
_APART_M = 1e-8
"""The largest distance between the surfaces of the two; planes of boxes are one within a tenth of it."""
_SHARE = 1e-3
"""Of the volume."""


def check_solid(solid: Solid, file: str) -> None:
    """Raise an `InputError` unless the boxes make a closed mesh that the faces enclose, with this volume and centroid.

    Both packages are slow to import and are so only here.
    """
    mesh = _mesh(solid)
    require(
        mesh.is_watertight,
        f"{file}: the boxes make no closed solid; move apart, or into each other, what nearly touches.",
    )
    room = _APART_M * float(mesh.area)
    reach = float(np.linalg.norm(np.diff(solid.bounds, axis=0)))
    # Divergence theorem: the volume inside of flat faces is a third of the sum of area times height over the origin.
    enclosed = sum(face_area(face) * float(face.normal @ face.outline[0]) for face in solid.faces.values()) / 3.0
    for name, volume in (("of its cells", solid.volume), ("that its faces enclose", enclosed)):
        require(
            abs(volume - mesh.volume) <= room,
            f"{file}: the volume {name} is {1e9 * volume:.6g} mm^3, that of a mesh of the same boxes "
            f"{1e9 * mesh.volume:.6g}; move apart, or into each other, what nearly touches.",
        )
    off = float(np.linalg.norm(mesh.center_mass - solid.centroid))
    require(
        off * solid.volume <= room * reach,
        f"{file}: the centroid is {1e3 * off:.3g} mm from that of a mesh of the same boxes.",
    )


def check_matter(solid: Solid, file: str, rounded: float) -> None:
    """Raise an `InputError` unless volume, centroid and inertia are those of the pieces, within 0.1 percent.

    Args:
        rounded: By how much round walls that are cut into flat ones may change the volume, [m^3].
    """
    assert solid.inertia is not None
    mesh = _mesh(solid)
    room = _SHARE * solid.volume + rounded
    reach = float(np.linalg.norm(np.diff(solid.bounds, axis=0)))
    require(
        abs(solid.volume - mesh.volume) <= room,
        f"{file}, volume_mm3: {1e9 * solid.volume:.6g} is stated, the pieces have {1e9 * mesh.volume:.6g}; only "
        "0.1 % and what round walls explain are allowed; state that of the exact solid, or mend the pieces.",
    )
    off = np.abs(mesh.center_mass - solid.centroid).max()
    if off * solid.volume > room * reach:
        at = ", ".join(f"{1e3 * x:.5g}" for x in mesh.center_mass)
        raise InputError(f"{file}, centroid_mm: that of the pieces is ({at}), {1e3 * off:.3g} mm from it; state that.")
    J = np.asarray(mesh.moment_inertia)
    if np.abs(J - solid.inertia).max() > room * reach**2 / 3.0:
        six = ", ".join(f"{1e15 * J[i, k]:.5g}" for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
        raise InputError(f"{file}, inertia_mm5: that of the pieces about their centroid is [{six}]; state that.")


def _mesh(solid: Solid) -> Any:
    """The union of the pieces as a mesh; vertices stay apart where the surface touches itself."""
    import manifold3d
    import trimesh

    pieces = [
        manifold3d.Manifold.cube(2.0 * piece.half, center=True).translate(piece.center)
        if isinstance(piece, Box)
        else manifold3d.Manifold.hull_points(piece.corners)
        for piece in solid.pieces
    ]
    mesh = manifold3d.Manifold.batch_boolean(pieces, manifold3d.OpType.Add).to_mesh64()
    return trimesh.Trimesh(mesh.vert_properties[:, :3], mesh.tri_verts, process=False)


def check_one_piece(pieces: Sequence[Piece], path: Path) -> None:
    """Raise an `InputError` unless every piece touches the others, over some of them."""
    groups = touching_groups(pieces)
    require(groups is not None, f"{path}: whether the pieces touch takes too long to find out; use fewer pieces.")
    assert groups is not None
    require(
        len(groups) <= 1,
        f"{path}: the pieces make {len(groups)} separate solids; a part is one rigid piece.",
    )


def touching_groups(pieces: Sequence[Piece]) -> list[set[int]] | None:
    """Which pieces touch each other, over some of them; None if that takes too long to find out."""
    from scipy.cluster.hierarchy import DisjointSet

    solids = DisjointSet(range(len(pieces)))
    tests = 0
    low = np.array([piece.center - piece.half for piece in pieces]) - _TOUCHING_M
    high = np.array([piece.center + piece.half for piece in pieces]) + _TOUCHING_M
    for i in range(len(pieces)):
        for k in np.flatnonzero((low[:i] <= high[i]).all(axis=1) & (high[:i] >= low[i]).all(axis=1)):
            if solids.connected(i, int(k)):
                continue
            tests += 1
            if tests > _MOST_TESTS:
                return None
            if _gap(pieces[i], pieces[int(k)]) < _TOUCHING_M:
                solids.merge(i, int(k))
    return list(solids.subsets())


def _gap(a: Piece, b: Piece) -> float:
    """How far two pieces are apart along the direction in which it is most, [m]; negative if they overlap."""
    axes = separating_axes(a, np.eye(3), b, np.eye(3))
    at, reach = shadow(a, np.eye(3), axes)
    on, room = shadow(b, np.eye(3), axes)
    return float((np.abs(at - on) - reach - room).max())
