"""Check the stated volume, centroid, inertia and faces of a part against its pieces."""

from collections.abc import Sequence

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import Piece, Solid, build_union_mesh, find_separating_axes, project_on_axes
from apo_bench.scenario.parts.face_checks import check_faces, check_receding
from apo_bench.scenario.parts.part_file import PartFile

_TOUCHING_M = 2e-5
"""Pieces with a smaller gap touch."""
APART_M = 1e-3
"""Pieces with a larger gap make separate solids; the balls of a bearing have a smaller one."""
_SHARE = 1e-3
"""Largest relative error of the stated volume."""


def check_matter(solid: Solid, file: str, rounded: float) -> None:
    """Raise an `InputError` unless volume, centroid and inertia are those of the pieces, within 0.1 percent.

    Args:
        file: The file, for messages.
        rounded: Largest error of the volume from round walls that are approximated by flat sides, [m^3].
    """
    assert solid.inertia is not None
    mesh = build_union_mesh(solid.pieces)
    room = _SHARE * solid.volume + rounded
    reach = float(np.linalg.norm(np.diff(solid.bounds, axis=0)))
    require(
        abs(solid.volume - mesh.volume) <= room,
        f"{file}, volume_mm3: {1e9 * solid.volume:.6g} is stated, the pieces have {1e9 * mesh.volume:.6g}.",
    )
    off = np.abs(mesh.center_mass - solid.centroid).max()
    if off * solid.volume > room * reach:
        at = ", ".join(f"{1e3 * x:.5g}" for x in mesh.center_mass)
        raise InputError(f"{file}, centroid_mm: that of the pieces is ({at}), {1e3 * off:.3g} mm from it; state that.")
    J = np.asarray(mesh.moment_inertia)
    if np.abs(J - solid.inertia).max() > room * reach**2 / 3.0:
        six = ", ".join(f"{1e15 * J[i, k]:.5g}" for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
        raise InputError(f"{file}, inertia_mm5: that of the pieces about their centroid is [{six}]; state that.")


def group_touching_pieces(pieces: Sequence[Piece], gap_m: float = _TOUCHING_M) -> list[set[int]]:
    """Group the indices of pieces with smaller gaps between them, directly or through other pieces."""
    from scipy.cluster.hierarchy import DisjointSet
    from scipy.spatial import cKDTree

    solids = DisjointSet(range(len(pieces)))
    # Most neighbours share corners, which is quick to see.
    owner = np.repeat(np.arange(len(pieces)), [len(piece.corners) for piece in pieces])
    shared = cKDTree(np.concatenate([piece.corners for piece in pieces])).query_pairs(gap_m, output_type="ndarray")
    for i, k in np.unique(owner[shared], axis=0).tolist():
        solids.merge(i, k)
    low = np.array([piece.center - piece.half for piece in pieces]) - gap_m
    high = np.array([piece.center + piece.half for piece in pieces]) + gap_m
    # Only pairs whose bounding boxes meet are tested.
    for i in range(len(pieces)):
        for k in np.flatnonzero((low[:i] <= high[i]).all(axis=1) & (high[:i] >= low[i]).all(axis=1)):
            if not solids.connected(i, int(k)) and _measure_gap(pieces[i], pieces[int(k)]) < gap_m:
                solids.merge(i, int(k))
    return list(solids.subsets())


def _measure_gap(a: Piece, b: Piece) -> float:
    """The largest gap between two pieces along any separating axis, [m]; negative if they overlap."""
    axes = find_separating_axes(a, np.eye(3), b, np.eye(3))
    at, reach = project_on_axes(a, np.eye(3), axes)
    on, room = project_on_axes(b, np.eye(3), axes)
    return float((np.abs(at - on) - reach - room).max())


def check_part(file: PartFile, solid: Solid) -> None:
    """Raise an `InputError` unless the stated properties of a part agree with its pieces."""
    if file.stated is not None:
        count = len(group_touching_pieces(solid.pieces, APART_M))
        require(count == 1, f"{file.path}: the pieces make {count} separate solids; a part is one rigid piece.")
        stated = file.path.with_suffix(".toml")
        check_matter(solid, str(stated), check_faces(solid, stated))
        check_receding(solid, stated)
