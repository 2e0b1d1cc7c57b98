"""3MF: the build of the root model places objects, which become meshes where they are; supports are left out."""

from collections.abc import Iterator, Sequence
from operator import add
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.cad.meshes.three_mf_package import (
    NO_NUMBER,
    ObjectKey,
    Package,
    PlacedObject,
    ThreeMfObject,
    read_package,
    refuse,
)
from apo_bench.cad.solids.raw_solid import Mesh
from apo_bench.errors import InputError
from apo_bench.geometry import Array

_MOST_PLACES = 2000
_DEEPEST_OBJECT = 8
_MODEL_TYPES = ("", "model")
"""Types of objects that are parts; `support`, `solidsupport`, `surface` and `other` are none."""
_Size = tuple[int, int, int, int]
"""What objects are made of, with all that is in them: places, triangles, corners; and how deep they are nested."""


class ThreeMf(NamedTuple):
    """What a 3MF file holds."""

    unit: str
    meshes: list[tuple[str, Mesh]]
    """One for each place of a part in the build, with its name."""
    left_out: int
    """How many meshes of the build are supports, surfaces or of another type than `model`."""


class _Placed(NamedTuple):
    """A mesh of the build at one of its places."""

    name: str
    of: ThreeMfObject
    T: Array
    """(4, 4), in units of the file."""
    is_part: bool


def read_3mf(path: Path, raw: bytes, most_triangles: int) -> ThreeMf:
    """The unit of a file, and a mesh for each place of an object in its build; supports are left out.

    Raises:
        InputError: It is no such file, larger than allowed when it is unpacked and its objects are placed, or needs an
            extension that is not read.
    """
    package = read_package(path, raw)
    size = _total(package, package.items, {}, ())
    limits = {"objects": _MOST_PLACES, "triangles": most_triangles, "corners": 3 * most_triangles}
    for (what, most), count in zip(limits.items(), size, strict=False):
        if count > most:
            number = f"{count:,}" if count < 10**12 else "very many"
            refuse(path, f"it places {number} {what}, {most:,} are the most")
    try:
        placed = [*_placed(package, package.items, np.eye(4), "")]
        meshes = [(each.name, _mesh(each.of, each.T)) for each in placed if each.is_part]
    except ValueError as error:
        raise InputError(f"{path}: {NO_NUMBER}; save the part again.") from error
    if placed and not meshes:
        refuse(path, "all that it places are supports, surfaces or other objects that are no parts")
    return ThreeMf(package.unit or "mm", meshes, len(placed) - len(meshes))


def _total(
    package: Package,
    components: Sequence[PlacedObject],
    known: dict[ObjectKey, _Size],
    within: tuple[ObjectKey, ...],
) -> _Size:
    """The sizes of objects together, each looked at once, however often it is placed.

    Args:
        within: The objects around these.
    """
    if len(within) > _DEEPEST_OBJECT:
        refuse(package.path, f"its objects are nested deeper than {_DEEPEST_OBJECT}")
    for key, _ in components:
        each = package.objects.get(key)
        if each is None:
            refuse(package.path, f"object '{key.number[:40]}' is not there")
        if key in within:
            refuse(package.path, f"object '{key.number[:40]}' is in itself")
        if key not in known:
            own = (1, len(each.corners) // 3, len(each.coordinates) // 3, 1)
            inner = _total(package, each.components, known, (*within, key))
            places, triangles, corners, depth = map(add, own, inner)
            known[key] = (places, triangles, corners, depth)
        if len(within) + known[key][3] > _DEEPEST_OBJECT:
            refuse(package.path, f"its objects are nested deeper than {_DEEPEST_OBJECT}")
    sizes = [known[key] for key, _ in components]
    places, triangles, corners, _ = map(sum, zip((0, 0, 0, 0), *sizes, strict=True))
    return places, triangles, corners, max((depth for *_, depth in sizes), default=0)


def _placed(
    package: Package, components: Sequence[PlacedObject], T: Array, around: str, is_part: bool = True
) -> Iterator[_Placed]:
    """All meshes in objects, where they are.

    Args:
        around: The name of the object that these are in, for those without one.
        is_part: Whether that object is a part.
    """
    for key, transform in components:
        each = package.objects[key]
        at = T @ _matrix(transform)
        name = each.name or around
        is_model = is_part and each.kind in _MODEL_TYPES
        if each.corners:
            yield _Placed(name or f"object{key.number}", each, at, is_model)
        yield from _placed(package, each.components, at, name, is_model)


def _matrix(text: str) -> Array:
    """The places of 3MF are rows: x' = x M."""
    T = np.eye(4)
    if text:
        T[:3] = np.array([float(word) for word in text.split()]).reshape(4, 3).T
    return T


def _mesh(each: ThreeMfObject, T: Array) -> Mesh:
    corners = np.array(each.coordinates).reshape(-1, 3) @ T[:3, :3].T + T[:3, 3]
    mesh = Mesh(corners, np.array(each.corners, dtype=np.int64).reshape(-1, 3))
    if mesh.triangles.min() < 0 or mesh.triangles.max() >= len(corners):
        raise ValueError("a triangle without its corners")
    return mesh.flipped() if np.linalg.det(T[:3, :3]) < 0.0 else mesh
