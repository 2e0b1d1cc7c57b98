"""The model in a 3MF file, read as a stream: what it holds is counted while it is read, and nothing else is kept."""

from __future__ import annotations

import zipfile
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import NamedTuple, NoReturn, final
from xml.parsers.expat import ExpatError, ParserCreate

from apo_bench.errors import InputError

_LARGEST_BYTES = 60_000_000
_LONGEST_TOKEN = 1_000_000
_PIECE = 1 << 16
_MOST_FILES = 10_000
_MOST_NAMES = 10_000
_MOST_OBJECTS = 10_000
_DEEPEST = 100
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""All that 3MF allows; the others are unpacked without a limit."""
_OBJECT = ("model", "resources", "object")


class Component(NamedTuple):
    """An object at a place, in another object or in the build."""

    number: str
    transform: str


@final
@dataclass(frozen=True)
class Object:
    """What a file calls an object: a mesh, or other objects at places."""

    name: str
    coordinates: array[float] = field(default_factory=lambda: array("d"))
    """x, y, z of each corner."""
    corners: array[int] = field(default_factory=lambda: array("q"))
    """Three of each triangle."""
    components: list[Component] = field(default_factory=list)


@final
class Model:
    """Objects by their numbers, and which of them the build places."""

    def __init__(self, path: Path) -> None:
        self.unit = "millimeter"
        self.objects: dict[str, Object] = {}
        self.items: list[Component] = []
        self._path = path
        self._within: list[str] = []
        self._open = Object("")
        self._count = 0

    def start(self, tag: str, said: dict[str, str]) -> None:
        """An element begins."""
        self._within.append(tag.rpartition("}")[2])
        if len(self._within) > _DEEPEST:
            refuse(self._path, f"its elements are nested deeper than {_DEEPEST}")
        where = tuple(self._within)
        if where == (*_OBJECT, "mesh", "vertices", "vertex"):
            self._open.coordinates.extend([float(said[axis]) for axis in "xyz"])
        elif where == (*_OBJECT, "mesh", "triangles", "triangle"):
            self._open.corners.extend([int(said[corner]) for corner in ("v1", "v2", "v3")])
        elif where == _OBJECT:
            number = said.get("id", "")
            self._open = Object(said.get("name", "") or f"object{number}")
            self.objects[number] = self._open
            self._counted()
        elif where == (*_OBJECT, "components", "component"):
            self._open.components.append(_component(said))
            self._counted()
        elif where == ("model", "build", "item"):
            self.items.append(_component(said))
            self._counted()
        elif where == ("model",):
            self.unit = said.get("unit", self.unit)

    def end(self, tag: str) -> None:
        """An element ends."""
        self._within.pop()

    def _counted(self) -> None:
        self._count += 1
        if self._count > _MOST_OBJECTS:
            refuse(self._path, f"it names more than {_MOST_OBJECTS:,} objects and places")


def read_model(path: Path, raw: bytes) -> Model:
    """The model of a file.

    Raises:
        InputError: It is no such file, or larger than allowed when it is unpacked.
    """
    model = Model(path)
    parser = ParserCreate(namespace_separator="}", intern={})
    parser.StartElementHandler = model.start
    parser.EndElementHandler = model.end
    parser.StartDoctypeDeclHandler = lambda *_: refuse(path, "it declares entities, which a 3MF file may not")
    size = 0
    try:
        for piece in _unpacked(path, raw):
            size += len(piece)
            parser.Parse(piece)
            if size - parser.CurrentByteIndex > _LONGEST_TOKEN or len(parser.intern) > _MOST_NAMES:
                refuse(path, "an element of it is too large, or there are too many kinds of them")
        parser.Parse(b"", True)
    except ExpatError as error:
        raise InputError(f"{path}: the model of the 3MF file is no XML; save the part again.") from error
    except (ValueError, KeyError, OverflowError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: a number in the 3MF file cannot be read; save the part again.") from error
    return model


def refuse(path: Path, what: str) -> NoReturn:
    raise InputError(f"{path}: the 3MF file cannot be used: {what}; save the part again.")


def _unpacked(path: Path, raw: bytes) -> Iterator[bytes]:
    """The bytes of the model, piece by piece."""
    if raw.count(b"PK\1\2") > _MOST_FILES:
        refuse(path, f"it holds more than {_MOST_FILES:,} files")
    try:
        with zipfile.ZipFile(BytesIO(raw)) as archive:
            entries = sorted(archive.infolist(), key=lambda entry: entry.filename)
            entry = next((each for each in entries if each.filename.lower().endswith(".model")), None)
            if entry is None:
                refuse(path, "it holds no model")
            if entry.file_size > _LARGEST_BYTES:
                refuse(path, f"it is larger than {_LARGEST_BYTES / 1e6:g} MB when it is unpacked")
            if entry.compress_type not in _METHODS:
                refuse(path, "it is packed in a way that 3MF does not allow")
            with archive.open(entry) as file:  # which ends at the size that was declared
                while piece := file.read(_PIECE):
                    yield piece
    except (InputError, MemoryError):
        raise
    except Exception as error:  # zipfile raises a dozen kinds for what is no zip
        raise InputError(f"{path}: this is no 3MF file that can be read; save the part again.") from error


def _component(said: dict[str, str]) -> Component:
    return Component(said.get("objectid", ""), said.get("transform", ""))
