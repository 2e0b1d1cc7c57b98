"""The models in a 3MF file, a zip: objects are meshes, or other objects at places, of any model; the root has a build.

Read here and not by a library: trimesh 5.2 takes objects of two models with one number for one object and supports for
parts, and lib3mf 2.5 rejects files of slicers for their identifiers. Models are read as streams: what they hold is
counted while they are read, and nothing else is kept.
"""

import zipfile
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import NamedTuple, NoReturn, final
from xml.parsers.expat import ExpatError, ParserCreate

from apo_bench.errors import InputError

_UNITS = {"micron": "um", "millimeter": "mm", "centimeter": "cm", "meter": "m", "inch": "in", "foot": "ft"}
_LARGEST_BYTES = 60_000_000
_LONGEST_TOKEN = 1_000_000
_PIECE = 1 << 16
_MOST_FILES = 10_000
_MOST_NAMES = 10_000
_MOST_OBJECTS = 10_000
_DEEPEST_ELEMENT = 100
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""All that 3MF allows; the others are unpacked without a limit."""
_OBJECT = ("model", "resources", "object")
_PLACES = ((*_OBJECT, "components", "component"), ("model", "build", "item"))
NO_NUMBER = "a number in the 3MF file cannot be read"
_CORE = "http://schemas.microsoft.com/3dmanufacturing/"
_KNOWN_EXTENSIONS = ("production/", "material/", "trianglesets/")
"""Extensions that change no shape, or are read here; a file that requires another one means another shape."""
_ROOT_TYPE = "/3dmodel"
"""How the type of the relationship ends that names the root model."""


class ObjectKey(NamedTuple):
    """What names an object: two models may have objects with one number."""

    model: str
    number: str


class PlacedObject(NamedTuple):
    """An object at a place, in another object or in the build."""

    key: ObjectKey
    transform: str


@final
@dataclass(frozen=True, eq=False)
class ThreeMfObject:
    """What a file calls an object: a mesh, or other objects at places."""

    name: str = ""
    kind: str = ""
    coordinates: "array[float]" = field(default_factory=lambda: array("d"))
    """x, y, z of each corner."""
    corners: "array[int]" = field(default_factory=lambda: array("q"))
    """Three of each triangle."""
    components: list[PlacedObject] = field(default_factory=list)


@final
class Package:
    """Objects of all models of a file, and which of them the build of the root model places."""

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        self.path = path
        self.unit = ""
        self.objects: dict[ObjectKey, ThreeMfObject] = {}
        self.items: list[PlacedObject] = []
        self._archive = archive
        self._files = {each.filename.strip("/").lower(): each for each in archive.infolist()}
        self._size = 0
        self._count = 0

    def read(self) -> None:
        """Read the root model, and every model that one which was read names."""
        root = self._root()
        left = [root]
        seen = {root}
        while left:
            model = _Model(self, left.pop(), is_root=len(seen) == 1)
            self._parse(model.name, model)
            left += sorted(model.named - seen)
            seen |= model.named

    def count_one(self) -> None:
        """Count one object or place.

        Raises:
            InputError: There are too many.
        """
        self._count += 1
        if self._count > _MOST_OBJECTS:
            refuse(self.path, f"it names more than {_MOST_OBJECTS:,} objects and places")

    def _root(self) -> str:
        """The name of the model that the relationships of the file name; without any, of the first."""
        found = _Relationships(self.path)
        if "_rels/.rels" in self._files:
            self._parse("_rels/.rels", found)
        names = [*found.targets, *sorted(name for name in self._files if name.endswith(".model"))]
        if not names:
            refuse(self.path, "it holds no model")
        return names[0]

    def _parse(self, name: str, reader: "_Model | _Relationships") -> None:
        """Read one file of the archive, element by element.

        Raises:
            InputError: It is not there, no XML, or larger than allowed when it is unpacked.
        """
        parser = ParserCreate(namespace_separator="}", intern={})
        parser.StartElementHandler = reader.start
        parser.EndElementHandler = lambda tag: reader.within.pop()
        parser.StartNamespaceDeclHandler = lambda prefix, uri: reader.namespaces.update({prefix or "": uri or ""})
        parser.StartDoctypeDeclHandler = lambda *_: refuse(self.path, "it declares entities, which a 3MF file may not")
        size = 0
        try:
            for piece in self._unpacked(name):
                size += len(piece)
                parser.Parse(piece)
                if size - parser.CurrentByteIndex > _LONGEST_TOKEN or len(parser.intern) > _MOST_NAMES:
                    refuse(self.path, "an element of it is too large, or there are too many kinds of them")
            parser.Parse(b"", True)
        except InputError:
            raise
        except ExpatError as error:
            raise InputError(f"{self.path}: '{name[:60]}' in the 3MF file is no XML; save the part again.") from error
        except (ValueError, KeyError, OverflowError) as error:
            raise InputError(f"{self.path}: {NO_NUMBER}; save the part again.") from error

    def _unpacked(self, name: str) -> Iterator[bytes]:
        """The bytes of one file of the archive, piece by piece."""
        entry = self._files.get(name)
        if entry is None:
            refuse(self.path, f"the model '{name[:60]}' that it names is not in it")
        self._size += entry.file_size
        if self._size > _LARGEST_BYTES:
            refuse(self.path, f"it is larger than {_LARGEST_BYTES / 1e6:g} MB when it is unpacked")
        if entry.compress_type not in _METHODS:
            refuse(self.path, "it is packed in a way that 3MF does not allow")
        try:
            with self._archive.open(entry) as file:  # which ends at the size that was declared
                while piece := file.read(_PIECE):
                    yield piece
        except MemoryError:
            raise
        except Exception as error:  # zipfile raises a dozen kinds for what is no zip
            raise _no_3mf(self.path) from error


@final
class _Relationships:
    """The root models that `_rels/.rels` names."""

    def __init__(self, path: Path) -> None:
        self.targets: list[str] = []
        self.within: list[str] = []
        self.namespaces: dict[str, str] = {}
        self._path = path

    def start(self, tag: str, values: dict[str, str]) -> None:
        """An element begins."""
        _go_into(self._path, self.within, tag)
        if self.within[-1] == "Relationship" and values.get("Type", "").endswith(_ROOT_TYPE):
            self.targets.append(_as_name(values.get("Target", "")))


@final
class _Model:
    """One model of a file, which adds its objects to those of all."""

    def __init__(self, package: Package, name: str, is_root: bool) -> None:
        self.name = name
        self.named: set[str] = set()
        """Other models that this one takes objects from."""
        self.within: list[str] = []
        self.namespaces: dict[str, str] = {}
        self._package = package
        self._is_root = is_root
        self._open = ThreeMfObject()

    def start(self, tag: str, values: dict[str, str]) -> None:
        """An element begins."""
        _go_into(self._package.path, self.within, tag)
        where = tuple(self.within)
        if where == (*_OBJECT, "mesh", "vertices", "vertex"):
            self._open.coordinates.extend([float(values[axis]) for axis in "xyz"])
        elif where == (*_OBJECT, "mesh", "triangles", "triangle"):
            self._open.corners.extend([int(values[corner]) for corner in ("v1", "v2", "v3")])
        elif where == _OBJECT:
            self._package.count_one()
            self._open = ThreeMfObject(values.get("name", ""), values.get("type", ""))
            self._package.objects[ObjectKey(self.name, values.get("id", ""))] = self._open
        elif where in _PLACES:
            self._package.count_one()
            self._place(values, where[1] == "build")
        elif where == ("model",):
            self._begin(values)

    def _begin(self, values: Mapping[str, str]) -> None:
        """Check what holds for the whole model: its unit, and extensions without which it means another shape."""
        package = self._package
        unit = values.get("unit", "millimeter")
        if unit not in _UNITS:
            refuse(package.path, f"unit '{unit[:40]}' is not one of {', '.join(_UNITS)}")
        package.unit = package.unit or _UNITS[unit]
        if _UNITS[unit] != package.unit:
            refuse(package.path, f"one of its models is in {package.unit}, another in {_UNITS[unit]}")
        for prefix in values.get("requiredextensions", "").split():
            uri = self.namespaces.get(prefix, prefix)
            if not uri.removeprefix(_CORE).startswith(_KNOWN_EXTENSIONS):
                refuse(package.path, f"its shapes need the extension '{uri[:80]}', which is not read")

    def _place(self, values: Mapping[str, str], is_build: bool) -> None:
        """Add a place of an object to the build, or to the object that is open."""
        path = next((value for key, value in values.items() if key.endswith("production/2015/06}path")), "")
        model = _as_name(path) if path else self.name
        placed = PlacedObject(ObjectKey(model, values.get("objectid", "")), values.get("transform", ""))
        if not is_build:
            self._open.components.append(placed)
        elif self._is_root:
            self._package.items.append(placed)
        self.named |= {model}


def _go_into(path: Path, within: list[str], tag: str) -> None:
    within.append(tag.rpartition("}")[2])
    if len(within) > _DEEPEST_ELEMENT:
        refuse(path, f"its elements are nested deeper than {_DEEPEST_ELEMENT}")


def _as_name(target: str) -> str:
    """The name of a file of the archive that a path means; names differ by more than their case."""
    return target.strip("/").lower()


def refuse(path: Path, what: str) -> NoReturn:
    raise InputError(f"{path}: the 3MF file cannot be used: {what}; save the part again.")


def _no_3mf(path: Path) -> InputError:
    return InputError(f"{path}: this is no 3MF file that can be read; save the part again.")


def read_package(path: Path, raw: bytes) -> Package:
    """The models of a file.

    Raises:
        InputError: It is no such file, or larger than allowed when it is unpacked.
    """
    if raw.count(b"PK\1\2") > _MOST_FILES:
        refuse(path, f"it holds more than {_MOST_FILES:,} files")
    try:
        with zipfile.ZipFile(BytesIO(raw)) as archive:
            package = Package(path, archive)
            package.read()
            return package
    except (InputError, MemoryError):
        raise
    except Exception as error:
        raise _no_3mf(path) from error
