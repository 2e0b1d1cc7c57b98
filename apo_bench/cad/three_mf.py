"""3MF: a zip of one model, whose build places objects; objects are meshes, or other objects at places."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.cad.raw import Mesh
from apo_bench.cad.three_mf_model import Component, Model, Object, read_model, refuse
from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array

_UNITS = {"micron": "um", "millimeter": "mm", "centimeter": "cm", "meter": "m", "inch": "in", "foot": "ft"}
_DEEPEST = 8
_MOST_PLACES = 2000
_TOO_DEEP = f"its objects are nested deeper than {_DEEPEST}"


class _Size(NamedTuple):
    """What objects are made of, with all that is in them."""

    places: int
    triangles: int
    corners: int
    depth: int


def read_3mf(path: Path, raw: bytes, most_triangles: int) -> tuple[str, list[tuple[str, Mesh]]]:
    """The unit of a file, and a mesh for each place of an object in its build, each with its name.

    Raises:
        InputError: It is no such file, or larger than allowed when it is unpacked and its objects are placed.
    """
    model = read_model(path, raw)
    unit = _UNITS.get(model.unit)
    if unit is None:
        refuse(path, f"unit '{model.unit[:40]}' is not one of {', '.join(_UNITS)}")
    size = _total(path, model, model.items, {}, ())
    for count, what, most in (
        (size.places, "objects", _MOST_PLACES),
        (size.triangles, "triangles", most_triangles),
        (size.corners, "corners", 3 * most_triangles),
    ):
        if count > most:
            refuse(path, f"it places {_count(count)} {what}, {most:,} are the most")
    try:
        return unit, [(each.name, _mesh(each, T)) for each, T in _placed(model, model.items, np.eye(4))]
    except ValueError as error:
        raise InputError(f"{path}: a number in the 3MF file cannot be read; save the part again.") from error


def _total(
    path: Path, model: Model, components: list[Component], known: dict[str, _Size], within: tuple[str, ...]
) -> _Size:
    """The sizes of objects together, each looked at once, however often it is placed.

    Args:
        within: The objects around these.
    """
    if len(within) > _DEEPEST:
        refuse(path, _TOO_DEEP)
    for number, _ in components:
        each = model.objects.get(number)
        if each is None:
            refuse(path, f"object '{number[:40]}' is not there")
        if number in within:
            refuse(path, f"object '{number[:40]}' is in itself")
        if number not in known:
            inner = _total(path, model, each.components, known, (*within, number))
            known[number] = _Size(
                1 + inner.places,
                len(each.corners) // 3 + inner.triangles,
                len(each.coordinates) // 3 + inner.corners,
                1 + inner.depth,
            )
        if len(within) + known[number].depth > _DEEPEST:
            refuse(path, _TOO_DEEP)
    sizes = [known[number] for number, _ in components]
    places, triangles, corners = (sum(size[k] for size in sizes) for k in range(3))
    return _Size(places, triangles, corners, max((size.depth for size in sizes), default=0))


def _placed(model: Model, components: list[Component], T: Array) -> Iterator[tuple[Object, Array]]:
    """Meshes of objects, and where they are."""
    for number, transform in components:
        each = model.objects[number]
        at = T @ _matrix(transform)
        if each.corners:
            yield each, at
        yield from _placed(model, each.components, at)


def _matrix(text: str) -> Array:
    """The places of 3MF are rows: x' = x M."""
    T = np.eye(4)
    if text:
        rows = np.array([float(word) for word in text.split()]).reshape(4, 3)
        T[:3, :3] = rows[:3].T
        T[:3, 3] = rows[3]
    return T


def _mesh(each: Object, T: Array) -> Mesh:
    corners = np.array(each.coordinates).reshape(-1, 3) @ T[:3, :3].T + T[:3, 3]
    triangles = np.array(each.corners, dtype=np.int64).reshape(-1, 3)
    if triangles.min() < 0 or triangles.max() >= len(corners):
        raise ValueError("a triangle without its corners")
    return Mesh(corners, triangles[:, ::-1] if np.linalg.det(T[:3, :3]) < 0.0 else triangles)


def _count(number: int) -> str:
    """A number, which may have many digits."""
    return f"{number:,}" if number < 10**12 else "very many"
