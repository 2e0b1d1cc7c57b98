"""Read 3MF files: the build of the root model places objects, which become meshes at their places.

trimesh 5.2 merges objects of different models with the same number, and reads supports as parts.
"""

import re
from collections.abc import Iterable, Iterator
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree
from zipfile import ZipFile

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.importers.cad.solids import Mesh

# Unit of 3MF -> unit of `--unit`.
_UNITS = {"micron": "um", "millimeter": "mm", "centimeter": "cm", "meter": "m", "inch": "in", "foot": "ft"}
_LARGEST_BYTES = 60_000_000  # of all models and relations, unpacked
_MOST_PLACES = 2000  # of objects that a file may place
_PART_TYPES = ("", "model")
"""Object types that are parts; `support`, `solidsupport`, `surface` and `other` are not."""
_KNOWN_EXTENSIONS = {"p", "m", "t"}
"""Prefixes of extensions that do not change the shape or are read here: production, materials, triangle sets."""
_ROOT = re.compile(rb'Target="/?([^"]+\.model)"')  # path of the root model in `_rels/.rels`
_Key = tuple[str, str]
"""Path of the model that holds an object, and the number of the object in it."""


class _Object(NamedTuple):
    """An object of a 3MF file: a mesh, or other objects at places."""

    name: str
    is_part: bool
    mesh: Mesh
    components: list[tuple[_Key, Array]]
    """Keys of the objects inside and their poses, (4, 4), in units of the file."""


def read_3mf(path: Path, raw: bytes) -> tuple[str, list[tuple[str, Mesh]], int]:
    """Read the objects that a file places.

    Returns:
        The unit; name and mesh of each placed part; the number of meshes that are supports or other non-parts.

    Raises:
        InputError: It is no such file, too large, or needs an extension that is not read.
    """
    try:
        with ZipFile(BytesIO(raw)) as archive:
            unit, objects, items = _read_models(path, archive)
        # The build is treated as one outer object that holds all items.
        build = _Object("", True, Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)), items)
        placed = _place_objects(path, objects, build, np.eye(4), ())
        every = [*islice(placed, _MOST_PLACES + 1)]
    except InputError:
        raise
    except Exception as error:  # zipfile and its libraries raise a dozen kinds
        raise InputError(f"{path}: this is no 3MF file that can be read; save the part again.") from error
    require(len(every) <= _MOST_PLACES, f"{path}: the 3MF file places more than {_MOST_PLACES:,} objects; split it.")
    solid = [each for each in every if len(each.mesh.triangles)]
    parts = [(each.name, each.mesh) for each in solid if each.is_part]
    require(parts or not solid, f"{path}: all that the 3MF file places are supports; save the parts as models.")
    return unit, parts, len(solid) - len(parts)


def _read_models(path: Path, archive: ZipFile) -> tuple[str, dict[_Key, _Object], list[tuple[_Key, Array]]]:
    """Return the unit, the objects of all models by key, and the items of the build of the root model."""
    files = {_normalise_path(each.filename): each for each in archive.infolist()}
    size = sum(each.file_size for name, each in files.items() if name.endswith((".model", ".rels")))
    require(size <= _LARGEST_BYTES, f"{path}: the 3MF file is larger than {_LARGEST_BYTES / 1e6:g} MB when unpacked.")
    models = {
        name: ElementTree.fromstring(archive.read(each)) for name, each in files.items() if name.endswith(".model")
    }
    related = _ROOT.search(archive.read(files["_rels/.rels"])) if "_rels/.rels" in files else None
    root = _normalise_path(related[1].decode()) if related else min(models)
    units = set()
    objects: dict[_Key, _Object] = {}
    for name, model in models.items():
        units.add(_UNITS[model.get("unit", "millimeter")])
        for prefix in set(model.get("requiredextensions", "").split()) - _KNOWN_EXTENSIONS:
            raise InputError(f"{path}: the 3MF file needs the extension '{prefix[:80]}', which is not read.")
        for each in model.iterfind("{*}resources/{*}object"):
            objects[name, each.get("id", "")] = _read_object(name, each)
    require(len(units) == 1, f"{path}: the models of the 3MF file are in {' and '.join(units)}; save it in one unit.")
    return units.pop(), objects, _read_places(root, models[root].iterfind("{*}build/{*}item"))


def _normalise_path(target: str) -> str:
    """Normalize a path inside the archive for comparison."""
    return target.strip("/").lower()


def _read_object(model: str, element: ElementTree.Element) -> _Object:
    """Read a mesh with its components.

    Args:
        model: Path of the model that holds the object.
    """
    corners = _read_attributes(element.iterfind("{*}mesh/{*}vertices/{*}vertex"), ("x", "y", "z")).astype(np.float64)
    triangles = _read_attributes(element.iterfind("{*}mesh/{*}triangles/{*}triangle"), ("v1", "v2", "v3")).astype(
        np.int64
    )
    if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(corners):
        raise ValueError("a triangle without its corners")
    components = _read_places(model, element.iterfind("{*}components/{*}component"))
    is_part = element.get("type", "") in _PART_TYPES
    return _Object(element.get("name", ""), is_part, Mesh(corners, triangles), components)


def _read_attributes(elements: Iterable[ElementTree.Element], names: tuple[str, str, str]) -> Any:
    """Return three attributes of each element as text, (n, 3)."""
    rows = [[each.attrib[name] for name in names] for each in elements]
    return np.array(rows, dtype=np.str_).reshape(-1, 3)


def _read_places(model: str, elements: Iterable[ElementTree.Element]) -> list[tuple[_Key, Array]]:
    """Return the keys and poses, (4, 4), of the components of an object, or of the items of a build.

    Args:
        model: Path of the model that holds the elements.
    """
    places = []
    for each in elements:
        # 3MF states transforms for row vectors, x' = x M, hence the transpose.
        T = np.eye(4)
        if words := each.get("transform", "").split():
            T[:3] = np.array(words, dtype=np.float64).reshape(4, 3).T
        # A path in another model, or the same model.
        named = next((value for key, value in each.items() if key.endswith("}path")), model)
        places.append(((_normalise_path(named), each.get("objectid", "")), T))
    return places


def _place_objects(
    path: Path, objects: dict[_Key, _Object], outer: _Object, T: Array, around: tuple[_Key, ...]
) -> Iterator[_Object]:
    """Yield the objects inside another one, at all depths, with meshes moved to their places.

    Args:
        T: (4, 4), pose of the outer object.
        around: Keys of the outer object and those around it, to detect cycles.
    """
    for key, T_inner in outer.components:
        require(key in objects, f"{path}: object '{key[1]}' is not in the 3MF file; save the part again.")
        require(key not in around, f"{path}: object '{key[1]}' of the 3MF file is in itself; save it again.")
        inner = objects[key]
        here = T @ T_inner
        mesh = Mesh(inner.mesh.corners @ here[:3, :3].T + here[:3, 3], inner.mesh.triangles)
        if np.linalg.det(here[:3, :3]) < 0.0:  # a mirrored triangle faces the other way
            mesh = mesh.flip()
        placed = _Object(inner.name or outer.name, outer.is_part and inner.is_part, mesh, inner.components)
        yield placed._replace(name=placed.name or f"object{key[1]}")
        yield from _place_objects(path, objects, placed, here, (*around, key))
