"""3MF: a zip of one model, whose build places objects; objects are meshes, or other objects at places.

The model is read as a stream: what it holds is counted while it is read, and nothing else is kept.
"""

import zipfile
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from operator import add
from pathlib import Path
from typing import NoReturn, final
from xml.parsers.expat import ExpatError, ParserCreate

import numpy as np

from apo_bench.cad.solids.raw_solid import Mesh
from apo_bench.errors import InputError
from apo_bench.geometry import Array

_UNITS = {"micron": "um", "millimeter": "mm", "centimeter": "cm", "meter": "m", "inch": "in", "foot": "ft"}
_LARGEST_BYTES = 60_000_000
_LONGEST_TOKEN = 1_000_000
_PIECE = 1 << 16
_MOST_FILES = 10_000
_MOST_NAMES = 10_000
_MOST_OBJECTS = 10_000
_MOST_PLACES = 2000
_DEEPEST_ELEMENT = 100
_DEEPEST_OBJECT = 8
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""All that 3MF allows; the others are unpacked without a limit."""
_OBJECT = ("model", "resources", "object")
_PLACES = ((*_OBJECT, "components", "component"), ("model", "build", "item"))
_NO_NUMBER = "a number in the 3MF file cannot be read"


_PlacedObject = tuple[str, str]
"""The number of an object at a place, in another object or in the build; and its transform."""
_Size = tuple[int, int, int, int]
"""What objects are made of, with all that is in them: places, triangles, corners; and how deep they are nested."""


@final
@dataclass(frozen=True)
class _Object:
    """What a file calls an object: a mesh, or other objects at places."""

    name: str
    coordinates: "array[float]" = field(default_factory=lambda: array("d"))
    """x, y, z of each corner."""
    corners: "array[int]" = field(default_factory=lambda: array("q"))
    """Three of each triangle."""
    components: list[_PlacedObject] = field(default_factory=list)


@final
class _Model:
    """Objects by their numbers, and which of them the build places."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.unit = "millimeter"
        self.objects: dict[str, _Object] = {}
        self.items: list[_PlacedObject] = []
        self.within: list[str] = []
        self._open = _Object("")
        self._count = 0

    def start(self, tag: str, values: dict[str, str]) -> None:
        """An element begins."""
        self.within.append(tag.rpartition("}")[2])
        if len(self.within) > _DEEPEST_ELEMENT:
            _refuse(self.path, f"its elements are nested deeper than {_DEEPEST_ELEMENT}")
        where = tuple(self.within)
        self._count += where == _OBJECT or where in _PLACES
        if self._count > _MOST_OBJECTS:
            _refuse(self.path, f"it names more than {_MOST_OBJECTS:,} objects and places")
        if where == (*_OBJECT, "mesh", "vertices", "vertex"):
            self._open.coordinates.extend([float(values[axis]) for axis in "xyz"])
        elif where == (*_OBJECT, "mesh", "triangles", "triangle"):
            self._open.corners.extend([int(values[corner]) for corner in ("v1", "v2", "v3")])
        elif where == _OBJECT:
            number = values.get("id", "")
            self._open = _Object(values.get("name", "") or f"object{number}")
            self.objects[number] = self._open
        elif where in _PLACES:
            owner = self.items if where[1] == "build" else self._open.components
            owner.append((values.get("objectid", ""), values.get("transform", "")))
        elif where == ("model",):
            self.unit = values.get("unit", self.unit)


def read_3mf(path: Path, raw: bytes, most_triangles: int) -> tuple[str, list[tuple[str, Mesh]]]:
    """The unit of a file, and a mesh for each place of an object in its build, each with its name.

    Raises:
        InputError: It is no such file, or larger than allowed when it is unpacked and its objects are placed.
    """
    model = _read_model(path, raw)
    if model.unit not in _UNITS:
        _refuse(path, f"unit '{model.unit[:40]}' is not one of {', '.join(_UNITS)}")
    size = _total(model, model.items, {}, ())
    limits = {"objects": _MOST_PLACES, "triangles": most_triangles, "corners": 3 * most_triangles}
    for (what, most), count in zip(limits.items(), size, strict=False):
        if count > most:
            number = f"{count:,}" if count < 10**12 else "very many"
            _refuse(path, f"it places {number} {what}, {most:,} are the most")
    try:
        return _UNITS[model.unit], [(each.name, _mesh(each, T)) for each, T in _placed(model, model.items, np.eye(4))]
    except ValueError as error:
        raise InputError(f"{path}: {_NO_NUMBER}; save the part again.") from error


def _read_model(path: Path, raw: bytes) -> _Model:
    """The model of a file.

    Raises:
        InputError: It is no such file, or larger than allowed when it is unpacked.
    """
    model = _Model(path)
    parser = ParserCreate(namespace_separator="}", intern={})
    parser.StartElementHandler = model.start
    parser.EndElementHandler = lambda tag: model.within.pop()
    parser.StartDoctypeDeclHandler = lambda *_: _refuse(path, "it declares entities, which a 3MF file may not")
    size = 0
    try:
        for piece in _unpacked(path, raw):
            size += len(piece)
            parser.Parse(piece)
            if size - parser.CurrentByteIndex > _LONGEST_TOKEN or len(parser.intern) > _MOST_NAMES:
                _refuse(path, "an element of it is too large, or there are too many kinds of them")
        parser.Parse(b"", True)
    except InputError:
        raise
    except ExpatError as error:
        raise InputError(f"{path}: the model of the 3MF file is no XML; save the part again.") from error
    except (ValueError, KeyError, OverflowError) as error:
        raise InputError(f"{path}: {_NO_NUMBER}; save the part again.") from error
    return model


def _refuse(path: Path, what: str) -> NoReturn:
    raise InputError(f"{path}: the 3MF file cannot be used: {what}; save the part again.")


def _unpacked(path: Path, raw: bytes) -> Iterator[bytes]:
    """The bytes of the model, piece by piece."""
    if raw.count(b"PK\1\2") > _MOST_FILES:
        _refuse(path, f"it holds more than {_MOST_FILES:,} files")
    try:
        with zipfile.ZipFile(BytesIO(raw)) as archive:
            entries = sorted(archive.infolist(), key=lambda entry: entry.filename)
            entry = next((each for each in entries if each.filename.lower().endswith(".model")), None)
            if entry is None:
                _refuse(path, "it holds no model")
            if entry.file_size > _LARGEST_BYTES:
                _refuse(path, f"it is larger than {_LARGEST_BYTES / 1e6:g} MB when it is unpacked")
            if entry.compress_type not in _METHODS:
                _refuse(path, "it is packed in a way that 3MF does not allow")
            with archive.open(entry) as file:  # which ends at the size that was declared
                while piece := file.read(_PIECE):
                    yield piece
    except (InputError, MemoryError):
        raise
    except Exception as error:  # zipfile raises a dozen kinds for what is no zip
        raise InputError(f"{path}: this is no 3MF file that can be read; save the part again.") from error


def _total(
    model: _Model, components: Sequence[_PlacedObject], known: dict[str, _Size], within: tuple[str, ...]
) -> _Size:
    """The sizes of objects together, each looked at once, however often it is placed.

    Args:
        within: The objects around these.
    """
    if len(within) > _DEEPEST_OBJECT:
        _refuse(model.path, f"its objects are nested deeper than {_DEEPEST_OBJECT}")
    for number, _ in components:
        each = model.objects.get(number)
        if each is None:
            _refuse(model.path, f"object '{number[:40]}' is not there")
        if number in within:
            _refuse(model.path, f"object '{number[:40]}' is in itself")
        if number not in known:
            own = (1, len(each.corners) // 3, len(each.coordinates) // 3, 1)
            inner = _total(model, each.components, known, (*within, number))
            places, triangles, corners, depth = map(add, own, inner)
            known[number] = (places, triangles, corners, depth)
        if len(within) + known[number][3] > _DEEPEST_OBJECT:
            _refuse(model.path, f"its objects are nested deeper than {_DEEPEST_OBJECT}")
    sizes = [known[number] for number, _ in components]
    places, triangles, corners, _ = map(sum, zip((0, 0, 0, 0), *sizes, strict=True))
    return places, triangles, corners, max((depth for *_, depth in sizes), default=0)


def _placed(model: _Model, components: Sequence[_PlacedObject], T: Array) -> Iterator[tuple[_Object, Array]]:
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
        T[:3] = np.array([float(word) for word in text.split()]).reshape(4, 3).T
    return T


def _mesh(each: _Object, T: Array) -> Mesh:
    corners = np.array(each.coordinates).reshape(-1, 3) @ T[:3, :3].T + T[:3, 3]
    mesh = Mesh(corners, np.array(each.corners, dtype=np.int64).reshape(-1, 3))
    if mesh.triangles.min() < 0 or mesh.triangles.max() >= len(corners):
        raise ValueError("a triangle without its corners")
    return mesh.flipped() if np.linalg.det(T[:3, :3]) < 0.0 else mesh
