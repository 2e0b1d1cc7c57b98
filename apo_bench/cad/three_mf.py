"""3MF: a zip of one model, whose build places objects; objects are meshes, or other objects at places."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import NoReturn
from xml.etree.ElementTree import Element, ParseError, fromstring

import numpy as np

from apo_bench.cad.raw import Mesh
from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array

_UNITS = {"micron": "um", "millimeter": "mm", "centimeter": "cm", "meter": "m", "inch": "in", "foot": "ft"}
_LARGEST_BYTES, _DEEPEST, _MOST_PLACES = 60_000_000, 8, 1000


def read_3mf(path: Path, raw: bytes) -> tuple[str, list[tuple[str, Mesh]]]:
    """The unit of a file, and a mesh for each place of an object in its build, each with its name.

    Raises:
        InputError: It is no such file, or larger than allowed when it is unpacked.
    """
    root = _model(path, raw)
    unit = _UNITS.get(root.get("unit", "millimeter"))
    if unit is None:
        _refuse(path, f"unit '{root.get('unit')}' is not one of {', '.join(_UNITS)}")
    try:
        objects = {each.get("id", ""): each for each in root.iterfind("{*}resources/{*}object")}
        places = [
            place
            for item in root.iterfind("{*}build/{*}item")
            for place in _placed(path, objects, item.get("objectid", ""), _matrix(item.get("transform")), 0)
        ]
        if len(places) > _MOST_PLACES:
            _refuse(path, f"it places {len(places)} objects, {_MOST_PLACES} are the most")
        return unit, [(name, _mesh(each, T)) for name, each, T in places]
    except (ValueError, TypeError, IndexError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: a number in the 3MF file cannot be read; save the part again.") from error


def _model(path: Path, raw: bytes) -> Element:
    try:
        with zipfile.ZipFile(BytesIO(raw)) as archive:
            name = next((n for n in sorted(archive.namelist()) if n.lower().endswith(".model")), None)
            if name is None:
                _refuse(path, "it holds no model")
            with archive.open(name) as file:
                text = file.read(_LARGEST_BYTES + 1)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise InputError(f"{path}: this is no 3MF file that can be read; save the part again.") from error
    if len(text) > _LARGEST_BYTES:
        _refuse(path, f"it is larger than {_LARGEST_BYTES / 1e6:g} MB when it is unpacked")
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        _refuse(path, "it declares entities, which a 3MF file may not")
    try:
        return fromstring(text)
    except ParseError as error:
        raise InputError(f"{path}: the model of the 3MF file is no XML; save the part again.") from error


def _placed(
    path: Path, objects: Mapping[str, Element], number: str, T: Array, depth: int
) -> Iterator[tuple[str, Element, Array]]:
    """Meshes of an object, each with its name and where it is."""
    each = objects.get(number)
    if each is None or depth > _DEEPEST:
        _refuse(path, f"object '{number}' is not there, or in itself")
    mesh = each.find("{*}mesh")
    if mesh is not None:
        yield each.get("name", "") or f"object{number}", mesh, T
    for inner in each.iterfind("{*}components/{*}component"):
        yield from _placed(path, objects, inner.get("objectid", ""), T @ _matrix(inner.get("transform")), depth + 1)


def _matrix(text: str | None) -> Array:
    """The places of 3MF are rows: x' = x M."""
    T = np.eye(4)
    if text:
        rows = np.array([float(word) for word in text.split()]).reshape(4, 3)
        T[:3, :3], T[:3, 3] = rows[:3].T, rows[3]
    return T


def _mesh(mesh: Element, T: Array) -> Mesh:
    points = [[float(v.get(k, "")) for k in "xyz"] for v in mesh.iterfind("{*}vertices/{*}vertex")]
    index = [[int(t.get(k, "")) for k in ("v1", "v2", "v3")] for t in mesh.iterfind("{*}triangles/{*}triangle")]
    corners = np.array(points, dtype=np.float64).reshape(-1, 3) @ T[:3, :3].T + T[:3, 3]
    triangles = np.array(index, dtype=np.int64).reshape(-1, 3)
    if len(triangles) and (triangles.min() < 0 or triangles.max() >= len(corners)):
        raise ValueError("a triangle without its corners")
    return Mesh(corners, triangles[:, ::-1] if np.linalg.det(T[:3, :3]) < 0.0 else triangles)


def _refuse(path: Path, what: str) -> NoReturn:
    raise InputError(f"{path}: the 3MF file cannot be used: {what}; save the part again.")
