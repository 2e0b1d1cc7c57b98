"""Meshes of part files: convex pieces, with corners of their own only, and the picture, which never collides."""

from collections.abc import Mapping
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array, Hull
from apo_bench.io import read_bytes

_SAME_M = 1e-7
"""Corners nearer to each other are one; a corner this far inside of the piece is none."""
_THINNEST_M = 1e-5
"""A piece is thicker than this across each of its sides."""
_MOST_SIDES = 330
_MOST_DIRECTIONS = 200
"""Of one piece, and of its edges: how deep two of them are in each other is asked along each pair of directions."""


def checked_hull(path: Path, name: str, corners: Array) -> Hull:
    """The piece with these corners, (k, 3), [m].

    Raises:
        InputError: A corner is repeated or inside of the others, or all lie in a plane.
    """
    from scipy.spatial import QhullError, cKDTree

    pairs = sorted(cKDTree(corners).query_pairs(_SAME_M))
    if pairs:
        i, k = pairs[0]
        raise InputError(f"{path}: corners {i + 1} and {k + 1} of piece '{name}' are the same; remove one of them.")
    hull = Hull(name, corners)
    try:
        below = hull.planes[:, 3] - corners @ hull.planes[:, :3].T
    except QhullError:
        below = np.zeros((1, 1))
    require(
        below.max(axis=0).min() >= _THINNEST_M,
        f"{path}: piece '{name}' is flat: a piece is thicker than {1e3 * _THINNEST_M:g} mm across each side; "
        "give it other corners, or remove it.",
    )
    require(
        len(hull.planes) <= _MOST_SIDES and len(hull.edges) <= _MOST_DIRECTIONS,
        f"{path}: piece '{name}' has {len(hull.planes)} sides, and {len(hull.edges)} directions of edges; "
        f"{_MOST_SIDES} and {_MOST_DIRECTIONS} are the most; give it fewer corners, or cut it.",
    )
    inside = below.min(axis=1)
    require(
        inside.max() <= _SAME_M,
        f"{path}: piece '{name}' is not convex: its corner {int(inside.argmax()) + 1} lies "
        f"{1e3 * inside.max():.3g} mm inside of the others; cut it into convex pieces.",
    )
    return hull


NEVER_COLLIDES: Mapping[str, str] = {"contype": "0", "conaffinity": "0", "group": "1"}
"""What a geom must say to be the picture."""
MOST_TRIANGLES = 20_000
_HEADER = 84
_TRIANGLE = 50
"""Bytes of a binary STL file."""
_LARGEST_M = 10.0
_HIDDEN_GROUP = "3"
"""Of MuJoCo's groups of geoms, 0 to 2 are shown."""


def is_picture(attributes: Mapping[str, str]) -> bool:
    """Whether a geom says that it is no piece."""
    return any(key in attributes for key in NEVER_COLLIDES)


def dress_picture(path: Path, root: Element, body: Element, geom: Element, attributes: Mapping[str, str]) -> None:
    """Write the triangles of the picture into the tree in place of the file, and hide the pieces.

    Raises:
        InputError: The geom is another one than a picture, or its file is no binary STL file of metres.
    """
    called = f"<geom> '{geom.attrib['name']}'"
    meshes = {mesh.attrib["name"]: mesh for mesh in root.iterfind("asset/mesh")}
    mesh = meshes.get(attributes.get("mesh", ""))
    right = all(attributes.get(key) == value for key, value in NEVER_COLLIDES.items())
    if attributes.get("type") != "mesh" or not right or mesh is None or "file" not in mesh.attrib:
        wanted = " ".join(f'{key}="{value}"' for key, value in NEVER_COLLIDES.items())
        raise InputError(
            f"{path}: {called} is a picture if it has {wanted} and a mesh with file=; give it these, or none of them."
        )
    triangles = _read_stl(path.parent / mesh.attrib.pop("file"))
    corners, index = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    mesh.set("vertex", " ".join(f"{x:.9g}" for x in corners.ravel()))
    mesh.set("face", " ".join(map(str, index.ravel())))
    mesh.set("inertia", "shell")
    geom.set("mass", "0")
    for other in body.iter("geom"):
        if other is not geom:
            other.set("group", _HIDDEN_GROUP)


def _read_stl(file: Path) -> Array:
    """The triangles, (t, 3, 3), [m]."""
    raw = read_bytes(file, "binary STL file", _HEADER + _TRIANGLE * MOST_TRIANGLES)
    count = int.from_bytes(raw[80:_HEADER], "little")
    require(
        len(raw) >= _HEADER + _TRIANGLE and len(raw) == _HEADER + _TRIANGLE * count,
        f"{file}: this is no binary STL file; save the mesh as one, in metres.",
    )
    row = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    corners = np.frombuffer(raw, dtype=row, offset=_HEADER)["corners"].astype(np.float64)
    require(
        (np.abs(corners) <= _LARGEST_M).all(),
        f"{file}: corners within {_LARGEST_M:g} m are needed; save the mesh in metres.",
    )
    require(
        np.ptp(corners.reshape(-1, 3), axis=0).min() > 0.0,
        f"{file}: all triangles lie in a plane; give a mesh of the part, or no picture.",
    )
    return np.asarray(corners)
