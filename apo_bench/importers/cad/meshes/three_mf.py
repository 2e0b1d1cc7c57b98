"""3MF: the build of the root model places objects, which become meshes where they are; supports are left out.

Read here and not by a library: trimesh 5.2 takes objects of two models with one number for one object and supports for
parts, and lib3mf 2.5 rejects files of slicers for their identifiers.
"""

from collections.abc import Iterable, Iterator, Sequence
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree
from zipfile import ZipFile, ZipInfo

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.importers.cad.solids.raw_solid import Mesh

_UNITS = {"micron": "um", "millimeter": "mm", "centimeter": "cm", "meter": "m", "inch": "in", "foot": "ft"}
_LARGEST_BYTES = 60_000_000
_MOST_PLACES = 2000
_MODEL_TYPES = ("", "model")
"""Types of objects that are parts; `support`, `solidsupport`, `surface` and `other` are none."""
_CORE = "http://schemas.microsoft.com/3dmanufacturing/"
_KNOWN_EXTENSIONS = ("production/", "material/", "trianglesets/")
"""Extensions that change no shape, or are read here; a file that requires another one means another shape."""
_ROOT_TYPE = "/3dmodel"
"""How the type of the relationship ends that names the root model."""
_Key = tuple[str, str]
"""The model of an object and its number: two models may have objects with one number."""


class ThreeMf(NamedTuple):
    """What a 3MF file holds."""

    unit: str
    meshes: list[tuple[str, Mesh]]
    """One for each place of a part in the build, with its name."""
    left_out: int
    """How many meshes of the build are supports, surfaces or of another type than `model`."""


class _Place(NamedTuple):
    """An object at a place, in another object or in the build."""

    key: _Key
    T: Array
    """(4, 4), in units of the file."""


class _Object(NamedTuple):
    """A mesh, or other objects at places."""

    name: str
    kind: str
    mesh: Mesh
    components: list[_Place]


class _Package(NamedTuple):
    """Objects of all models of a file, and which of them the build of the root model places."""

    unit: str
    objects: dict[_Key, _Object]
    items: list[_Place]


def read_3mf(path: Path, raw: bytes) -> ThreeMf:
    """The unit of a file, and a mesh for each place of an object in its build; supports are left out.

    Raises:
        InputError: It is no such file, too large, or needs an extension that is not read.
    """
    try:
        with ZipFile(BytesIO(raw)) as archive:
            package = _read_package(path, archive)
        every = [*islice(_placed(path, package, package.items, _Within(np.eye(4))), _MOST_PLACES + 1)]
    except InputError:
        raise
    except Exception as error:  # zipfile and what it calls raise a dozen kinds for what is no zip
        raise InputError(f"{path}: this is no 3MF file that can be read; save the part again.") from error
    require(len(every) <= _MOST_PLACES, f"{path}: the 3MF file places more than {_MOST_PLACES:,} objects; split it.")
    meshes = [(name, mesh) for name, mesh, is_part in every if is_part and len(mesh.triangles)]
    left_out = sum(len(mesh.triangles) > 0 for _, mesh, _ in every) - len(meshes)
    require(meshes or not left_out, f"{path}: all that the 3MF file places are supports or others that are no parts.")
    return ThreeMf(package.unit, meshes, left_out)


def _read_package(path: Path, archive: ZipFile) -> _Package:
    """Read the root model, and every model that one which was read names."""
    files = {each.filename.strip("/").lower(): each for each in archive.infolist()}
    size = sum(each.file_size for name, each in files.items() if name.endswith((".model", ".rels")))
    require(size <= _LARGEST_BYTES, f"{path}: the 3MF file is larger than {_LARGEST_BYTES / 1e6:g} MB when unpacked.")
    root = _root_of(archive, files)
    names = [root]
    objects: dict[_Key, _Object] = {}
    items: list[_Place] = []
    units: dict[str, None] = {}
    for name in names:
        require(name in files, f"{path}: the model '{name}' that the 3MF file names is not in it; save the part again.")
        model, namespaces = _parse(archive.read(files[name]))
        _check_extensions(path, model, namespaces)
        units[_UNITS[model.get("unit", "millimeter")]] = None
        own = {
            (name, each.get("id", "")): _read_object(name, each) for each in model.iterfind("{*}resources/{*}object")
        }
        objects |= own
        if name == root:
            items = _read_places(name, model.iterfind("{*}build/{*}item"))
        places = [*items, *(place for each in own.values() for place in each.components)]
        names += sorted({place.key[0] for place in places} - {*names})
    require(len(units) == 1, f"{path}: one model of the 3MF file is in {', another in '.join(units)}; save it again.")
    return _Package(next(iter(units)), objects, items)


def _root_of(archive: ZipFile, files: dict[str, ZipInfo]) -> str:
    """The name of the model that the relationships of the file name; without any, of the first.

    Raises:
        IndexError: There is no model.
    """
    targets: list[str] = []
    if "_rels/.rels" in files:
        related, _ = _parse(archive.read(files["_rels/.rels"]))
        found = (each for each in related if each.get("Type", "").endswith(_ROOT_TYPE))
        targets = [_as_name(each.get("Target", "")) for each in found]
    return [*targets, *sorted(name for name in files if name.endswith(".model"))][0]


def _parse(raw: bytes) -> tuple[ElementTree.Element, dict[str, str]]:
    """The root element of a file, and the namespaces of its prefixes."""
    namespaces: dict[str, str] = {}
    root: Any = None
    for event, value in ElementTree.iterparse(BytesIO(raw), ("start-ns", "end")):
        if event == "end":
            root = value
        else:
            namespaces |= [value]
    return root, namespaces


def _check_extensions(path: Path, model: ElementTree.Element, namespaces: dict[str, str]) -> None:
    """Raise an `InputError` if a model means another shape without an extension that is not read."""
    for prefix in model.get("requiredextensions", "").split():
        uri = namespaces.get(prefix, prefix)
        is_known = uri.removeprefix(_CORE).startswith(_KNOWN_EXTENSIONS)
        require(is_known, f"{path}: shapes in the 3MF file need the extension '{uri[:80]}', which is not read.")


def _read_object(model: str, element: ElementTree.Element) -> _Object:
    """An object of a model.

    Raises:
        KeyError: A number is missing.
        ValueError: One cannot be read, or a triangle has no corners.
    """
    corners = _numbers(element.iterfind("{*}mesh/{*}vertices/{*}vertex"), "x", "y", "z").astype(np.float64)
    triangles = _numbers(element.iterfind("{*}mesh/{*}triangles/{*}triangle"), "v1", "v2", "v3").astype(np.int64)
    if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(corners):
        raise ValueError("a triangle without its corners")
    components = _read_places(model, element.iterfind("{*}components/{*}component"))
    return _Object(element.get("name", ""), element.get("type", ""), Mesh(corners, triangles), components)


def _numbers(elements: Iterable[ElementTree.Element], a: str, b: str, c: str) -> Any:
    """Three attributes of each element, (n, 3)."""
    rows = []
    for each in elements:
        rows += [each.attrib[a], each.attrib[b], each.attrib[c]]
    return np.array(rows, dtype=np.str_).reshape(-1, 3)


def _read_places(model: str, elements: Iterable[ElementTree.Element]) -> list[_Place]:
    """Components of an object, or items of a build."""
    places = []
    for each in elements:
        # The places of 3MF are rows: x' = x M.
        T = np.eye(4)
        if words := each.get("transform", "").split():
            T[:3] = np.array(words, dtype=np.float64).reshape(4, 3).T
        named = next((value for key, value in each.items() if key.endswith("production/2015/06}path")), model)
        places.append(_Place((_as_name(named), each.get("objectid", "")), T))
    return places


def _as_name(target: str) -> str:
    """The name of a file of the archive that a path means."""
    return target.strip("/").lower()


class _Within(NamedTuple):
    """What is around an object at its place."""

    T: Array
    name: str = ""
    is_part: bool = True
    keys: tuple[_Key, ...] = ()


def _placed(
    path: Path, package: _Package, places: Sequence[_Place], around: _Within
) -> Iterator[tuple[str, Mesh, bool]]:
    """All objects in the build where they are: name, mesh, and whether it is a part."""
    for key, T in places:
        require(key in package.objects, f"{path}: object '{key[1]}' is not in the 3MF file; save the part again.")
        require(key not in around.keys, f"{path}: object '{key[1]}' of the 3MF file is in itself; save it again.")
        each = package.objects[key]
        is_part = around.is_part and each.kind in _MODEL_TYPES
        here = _Within(around.T @ T, each.name or around.name, is_part, (*around.keys, key))
        yield here.name or f"object{key[1]}", _moved(each.mesh, here.T), is_part
        yield from _placed(path, package, each.components, here)


def _moved(mesh: Mesh, T: Array) -> Mesh:
    """At a place; one that mirrors turns triangles the other way."""
    moved = Mesh(mesh.corners @ T[:3, :3].T + T[:3, 3], mesh.triangles)
    return moved.flipped() if np.linalg.det(T[:3, :3]) < 0.0 else moved
