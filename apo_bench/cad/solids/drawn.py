"""What a part was drawn as: the mesh is kept beside the part file, and two of them are measured where they overlap."""

import os
from io import BytesIO
from pathlib import Path
from typing import NamedTuple
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

import numpy as np

from apo_bench.cad.solids.raw_solid import Mesh
from apo_bench.errors import InputError
from apo_bench.geometry import Array
from apo_bench.io import read_bytes, replace_file

_SUFFIX = ".drawn.npz"
_LARGEST_BYTES = 20_000_000
"""Of the file, and of each of its arrays when it is unpacked: twice what the largest part has."""
_MOST_FILES = 100
_FINE = 12.0
_MOST_POINTS = 200
_AT_ONCE = 1_000_000
"""Edges of an overlap are cut to this part of its size, and so many points of it measured; so many pairs of a point and
a triangle together, which bounds the memory."""


class Overlap(NamedTuple):
    """How far two solids are in each other."""

    depth_m: float
    """From a point in both of them to the nearest surface of the one, or of the other, at most."""
    at: Array
    """That point, (3,), world, [m]."""


def keep_drawn(mesh: Mesh, part_file: Path) -> None:
    """Write the mesh of a part, [mm], beside its file."""
    triangles = np.asarray(mesh.triangles, dtype=np.int32)
    with replace_file(part_file.with_suffix(_SUFFIX)) as file:
        np.savez_compressed(file, corners=mesh.corners, triangles=triangles)


def drawn_mesh(part_file: Path) -> Mesh | None:
    """The mesh that was kept beside a part file, [mm]; None if none was.

    Raises:
        InputError: What is there is no such mesh.
    """
    path = part_file.with_suffix(_SUFFIX)
    if not os.path.lexists(path):
        return None
    raw = read_bytes(path, "mesh that an import kept", _LARGEST_BYTES)
    try:
        if raw.count(b"PK\1\2") > _MOST_FILES:
            raise ValueError("too many files")
        with ZipFile(BytesIO(raw)) as archive:
            corners = _array(archive, "corners.npy", np.dtype("<f8"))
            triangles = _array(archive, "triangles.npy", np.dtype("<i4"))
        if not np.isfinite(corners).all() or not len(triangles):
            raise ValueError("no corners")
        if triangles.min() < 0 or triangles.max() >= len(corners):
            raise ValueError("a triangle without its corners")
    except MemoryError:
        raise
    except Exception as error:  # zipfile and NumPy raise a dozen kinds for what is no archive of arrays
        raise InputError(
            f"{path}: this is no mesh that an import kept; delete it, or import the part again."
        ) from error
    return Mesh(corners, triangles)


def _array(archive: ZipFile, name: str, dtype: np.dtype) -> Array:
    """Rows of three numbers of one type, (n, 3); nothing is unpacked before its size is known.

    Raises:
        ValueError: It is anything else.
    """
    entry = archive.getinfo(name)
    if entry.file_size > _LARGEST_BYTES or entry.compress_type not in (ZIP_STORED, ZIP_DEFLATED):
        raise ValueError("too large")
    file = BytesIO(archive.read(entry))
    if np.lib.format.read_magic(file) != (1, 0):
        raise ValueError("another version")
    shape, is_turned, stated = np.lib.format.read_array_header_1_0(file)
    rest = file.read()
    rows = len(rest) // (3 * dtype.itemsize)
    if stated != dtype or is_turned or shape != (rows, 3) or len(rest) != rows * 3 * dtype.itemsize:
        raise ValueError("another kind of array")
    return np.frombuffer(rest, dtype).reshape(rows, 3)


def overlap(a: Mesh, T_a: Array, b: Mesh, T_b: Array) -> Overlap | None:
    """Where two posed meshes, [mm], are deepest in each other; None if one of them makes no solid.

    Args:
        T_a: (4, 4), [m], as `T_b`.
    """
    import manifold3d

    # In mm: what looks for the nearest point of a triangle takes one of a square millimetre in metres for none.
    placed = [mesh.corners @ T[:3, :3].T + 1e3 * T[:3, 3] for T, mesh in ((T_a, a), (T_b, b))]
    solids = [
        manifold3d.Manifold(manifold3d.Mesh64(np.ascontiguousarray(corners), mesh.triangles.astype(np.uint64)))
        for corners, mesh in zip(placed, (a, b), strict=True)
    ]
    if any(solid.status() != manifold3d.Error.NoError for solid in solids):
        return None
    common = solids[0] ^ solids[1]
    if common.is_empty():
        return Overlap(0.0, np.zeros(3))
    low, high = np.reshape(common.bounding_box(), (2, 3))
    points = np.asarray(common.refine_to_length((high - low).max() / _FINE).to_mesh64().vert_properties)[:, :3]
    points = points[:: 1 + len(points) // _MOST_POINTS]
    # Every point lies on the surface of one; how deep it is in the other one is how far from that one's.
    depths = np.max([_from_surface(points, corners[m.triangles]) for corners, m in zip(placed, (a, b), strict=True)], 0)
    deepest = int(depths.argmax())
    return Overlap(1e-3 * float(depths[deepest]), 1e-3 * points[deepest])


def _from_surface(points: Array, triangles: Array) -> Array:
    """How far points, (k, 3), are from the nearest of triangles, (t, 3, 3), (k,)."""
    from trimesh.triangles import closest_point

    low, high = points.min(axis=0), points.max(axis=0)
    # Nothing that is farther from all of them than the nearest corner is from any can be nearest to one.
    reach = np.linalg.norm(high - low) + np.linalg.norm(triangles[:, 0] - points[0], axis=1).min()
    near = (triangles.min(axis=1) <= high + reach).all(axis=1) & (triangles.max(axis=1) >= low - reach).all(axis=1)
    triangles = triangles[near]
    least = np.full(len(points), np.inf)
    step = max(1, _AT_ONCE // len(points))
    for first in range(0, len(triangles), step):
        part = triangles[first : first + step]
        nearest = closest_point(  # type: ignore[no-untyped-call]
            np.tile(part, (len(points), 1, 1)), np.repeat(points, len(part), axis=0)
        )
        away = np.linalg.norm(nearest.reshape(len(points), len(part), 3) - points[:, None], axis=2)
        least = np.minimum(least, away.min(axis=1))
    return least
