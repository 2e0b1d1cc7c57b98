"""OBJ: corners and polygons become triangles that cover each polygon once, also where it is concave.

Read here and not by trimesh 5.2, which cuts every polygon into a fan from its first corner: a concave one becomes
another surface.
"""

from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.importers.cad.solids.raw_solid import Mesh, square_to

_SAME_AREA = 1e-6
"""Triangles cover a polygon once if their areas add up to its area within this part."""


def read_obj(path: Path, raw: bytes) -> Mesh:
    """The mesh of all faces of a file.

    Raises:
        InputError: It is no OBJ file, or a polygon crosses itself.
    """
    try:
        corners, polygons = _read_polygons(raw)
    except (ValueError, OverflowError) as error:
        raise InputError(f"{path}: this is no OBJ file that can be read; save the part again.") from error
    triangles = [np.zeros((0, 3), dtype=np.int64)]
    for number, polygon in enumerate(polygons, start=1):
        cut = polygon[None] if len(polygon) == 3 else _triangulate(corners[polygon], polygon)
        require(cut is not None, f"{path}: face {number:,} crosses itself; save the part with triangles only.")
        triangles.append(cut)
    return Mesh(corners, np.concatenate(triangles))


def _read_polygons(raw: bytes) -> tuple[Array, list[Any]]:
    """Corners, (k, 3), and the corners of each face, (n,).

    Raises:
        ValueError: A line is not as OBJ has it.
    """
    corners = []
    polygons = []
    for line in raw.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines():
        key, *words = line.split() or [b""]
        if key == b"v":
            x, y, z, *_ = map(float, words)
            corners.append((x, y, z))
        elif key == b"f":
            # Corners count from 1, or backwards from the last one that was read.
            given = np.array([int(word.split(b"/")[0]) for word in words])
            polygons.append(np.where(given > 0, given - 1, np.where(given < 0, given + len(corners), -1)))
    every = np.array(corners).reshape(-1, 3)
    if not np.isfinite(every).all() or any(len(p) < 3 or p.min() < 0 or p.max() >= len(every) for p in polygons):
        raise ValueError("a face without its corners")
    return every, polygons


def _triangulate(points: Array, polygon: Any) -> Any:
    """Triangles, (n - 2, 3), of a polygon with these points, (n, 3); None if they cannot cover it once."""
    import manifold3d

    points = points - points[0]
    # Newell: the sum of all p x q over sides from p to q is twice the area, along the normal.
    twice = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    area = float(np.linalg.norm(twice)) / 2.0
    fan = np.column_stack([np.zeros(len(polygon) - 2, int), *(np.arange(len(polygon) - 2) + k for k in (1, 2))])
    if area == 0.0:
        return polygon[fan]
    flat = points @ np.array(square_to(twice / (2.0 * area))).T
    cut = np.asarray(manifold3d.triangulate([flat]), dtype=np.int64).reshape(-1, 3)
    a, b, c = (flat[cut[:, k]] for k in range(3))
    p, q = b - a, c - a
    covered = float(np.abs(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum()) / 2.0
    return polygon[cut] if len(cut) == len(fan) and abs(covered - area) <= _SAME_AREA * area else None
