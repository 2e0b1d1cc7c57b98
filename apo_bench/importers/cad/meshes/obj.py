"""Read OBJ files; polygons, concave ones too, are triangulated so that triangles cover each polygon once.

trimesh 5.2 cuts every polygon into a fan from its first corner, which changes the surface of a concave one.
"""

from pathlib import Path
from typing import Any

import manifold3d
import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.importers.cad.solids import Mesh, find_square_axes

_SAME_AREA = 1e-6
"""Triangles cover a polygon once if the sum of their areas equals its area within this share."""


def read_obj(path: Path, raw: bytes) -> Mesh:
    """Read all faces of a file as one mesh.

    Raises:
        InputError: It is no OBJ file, or a polygon crosses itself.
    """
    corners = []
    polygons = []
    try:
        for line in raw.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines():
            key, *words = line.split() or [b""]
            if key == b"v":
                corners.append([float(word) for word in words[:3]])
            elif key == b"f":
                # Corners count from 1, or backwards from the last one that was read.
                given = np.array([int(word.split(b"/")[0]) for word in words])
                polygons.append(np.where(given < 0, given + len(corners), given - 1))
        every = np.array(corners, dtype=np.float64).reshape(-1, 3)
        if any(len(polygon) < 3 or polygon.min() < 0 for polygon in polygons):
            raise ValueError("a face without its corners")
        triangles = [_triangulate(every[polygon], polygon) for polygon in polygons]
    except (ValueError, OverflowError, IndexError) as error:
        raise InputError(f"{path}: this is no OBJ file that can be read; save the part again.") from error
    for number, cut in enumerate(triangles, start=1):
        require(cut is not None, f"{path}: face {number:,} crosses itself; save the part with triangles only.")
    return Mesh(every, np.concatenate([np.zeros((0, 3), dtype=np.int64), *triangles]))


def _triangulate(points: Array, polygon: Any) -> Any:
    """Triangulate a polygon.

    Args:
        points: (n, 3), its corners.
        polygon: (n,), their numbers in the file.

    Returns:
        Triangles of those numbers, (n - 2, 3), none for a polygon without area; None if it crosses itself.
    """
    if len(polygon) == 3:
        return polygon[None]
    points = points - points[0]
    # Newell: the sum of all p x q over sides from p to q is twice the area, along the normal.
    twice = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    area = float(np.linalg.norm(twice)) / 2.0
    if area == 0.0:
        return np.zeros((0, 3), dtype=np.int64)
    flat = points @ np.array(find_square_axes(twice / (2.0 * area))).T
    cut = np.asarray(manifold3d.triangulate([flat]), dtype=np.int64).reshape(-1, 3)
    p, q = flat[cut[:, 1]] - flat[cut[:, 0]], flat[cut[:, 2]] - flat[cut[:, 0]]
    covered = float(np.abs(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum()) / 2.0
    is_whole = len(cut) == len(polygon) - 2 and abs(covered - area) <= _SAME_AREA * area
    return polygon[cut] if is_whole else None
