"""A part file: MJCF with one body of named convex pieces; of boxes alone, sites name faces. No simulator needed."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import final
from xml.etree.ElementTree import Element, tostring

import numpy as np

from apo_bench.errors import InputError, require
from apo_bench.geometry import Array, Box, Cylinder, Piece, all_boxes, cylinder_hull
from apo_bench.io import named_files
from apo_bench.parts.allowed import MOST_BOXES, MOST_CORNERS_IN_ALL, WIDEST_M, read_tree
from apo_bench.parts.meshes import checked_hull, dress_picture, is_picture
from apo_bench.parts.stated import USUAL_DENSITY, StatedPart, read_stated_part

_FIT_CLASS = "fit"
_SHORTEST_AXIS = 1e-3


@final
@dataclass(frozen=True, eq=False)
class Mark:
    """A site: the face on which it lies gets its name."""

    name: str
    point: Array
    """(3,), frame of the part, [m]."""
    fit: bool


@final
@dataclass(frozen=True, eq=False)
class PartFile:
    """What a part file says."""

    path: Path
    pieces: tuple[Piece, ...]
    """Named and ordered as the geoms."""
    marks: tuple[Mark, ...]
    """Of boxes alone."""
    stated: StatedPart | None
    """What stands beside it; None of boxes alone."""
    density: float
    """[kg/m^3]."""
    xml: str
    """The part as MJCF, written anew: all that a simulator may be told of it."""


def part_files_of(path: Path) -> tuple[Path, ...]:
    """The files that a part is made of: its part file, the picture that this names, and the file beside it."""
    beside = path.with_suffix(".toml")
    return (*named_files(path), *([beside] if beside.is_file() else []))


def read_part(path: Path) -> PartFile:
    """Read a part file; once, as long as it and the file beside it stay as they are.

    Raises:
        InputError: The file cannot be read, is no XML, or is not one body of named pieces; or so the one beside it.
    """
    return _kept(path, _stamp(path), _stamp(path.with_suffix(".toml")))


def _stamp(path: Path) -> tuple[int, int, int] | None:
    """Time, size and number of a file; None if there is none."""
    try:
        stat = path.stat()
    except (OSError, ValueError):
        return None
    return stat.st_mtime_ns, stat.st_size, stat.st_ino


@lru_cache(maxsize=64)
def _kept(path: Path, *stamps: tuple[int, int, int] | None) -> PartFile:
    root = read_tree(path)
    body = root.find("worldbody/body")
    if body is None:
        raise InputError(f"{path}: there is no body; put the boxes of the part into one <body> in <worldbody>.")
    defaults = _defaults(path, root)
    elements = [(child, _resolved(path, child, defaults)) for child in body]
    pictures = [(e, a) for e, a in elements if e.tag == "geom" and is_picture(a)]
    if len(pictures) > 1:
        raise InputError(f"{path}: {_called(pictures[1][0])} is a second picture; a part has one at most.")
    for element, attributes in pictures:
        dress_picture(path, root, body, element, attributes)
    meshes = _meshes(path, root)
    geoms = [(_piece(path, e, a, meshes), a) for e, a in elements if e.tag == "geom" and not is_picture(a)]
    marks = tuple(_mark(path, e, a) for e, a in elements if e.tag == "site")
    _check_names(path, "geom", [e.attrib["name"] for e, _ in elements if e.tag == "geom"])
    require(geoms, f"{path}: body '{body.get('name', '')}' has no geom; give it at least one named box.")
    if meshes:
        raise InputError(f"{path}: no geom has the mesh '{min(meshes)}'; give it one, or remove the mesh.")
    pieces = tuple(piece for piece, _ in geoms)
    _check_names(path, "site", [mark.name for mark in marks])
    if all_boxes(pieces):
        require(
            len(pieces) <= MOST_BOXES,
            f"{path}: the part has {len(pieces)} boxes; {MOST_BOXES} are the most that it may have.",
        )
        density = _density(path, [attributes for _, attributes in geoms])
        return PartFile(path, pieces, marks, None, density, tostring(root, encoding="unicode"))
    if marks:
        raise InputError(
            f"{path}: site '{marks[0].name}' is given; where pieces are not boxes alone, faces stand in "
            f"{path.with_suffix('.toml').name}, so remove it."
        )
    stated = read_stated_part(path.with_suffix(".toml"))
    _state_matter(path, root, body, stated)
    return PartFile(path, pieces, (), stated, stated.density, tostring(root, encoding="unicode"))


def _density(path: Path, geoms: list[Mapping[str, str]]) -> float:
    densities = sorted({float(each.get("density", USUAL_DENSITY)) for each in geoms})
    require(
        len(densities) <= 1,
        f"{path}: the geoms have densities from {densities[0]:g} to {densities[-1]:g} kg/m^3; a part has one.",
    )
    return densities[0]


def _state_matter(path: Path, root: Element, body: Element, stated: StatedPart) -> None:
    """Write density and friction of the file beside it into the geoms, which may not say them."""
    for geom in root.iter("geom"):
        for key in ("density", "friction"):
            require(
                key not in geom.attrib,
                f"{path}: {_called(geom)} has {key}=; where pieces are not boxes alone, it stands in "
                f"{path.with_suffix('.toml').name}, so remove it here.",
            )
    matter = {"density": repr(stated.density)}
    if stated.friction:
        matter["friction"] = " ".join(map(repr, stated.friction))
    for geom in body.iter("geom"):
        geom.attrib.update({} if "mass" in geom.attrib else matter)


def _check_names(path: Path, kind: str, names: list[str]) -> None:
    name, count = max(Counter(names).items(), key=lambda item: item[1], default=("", 0))
    require(count <= 1, f"{path}: two {kind}s are called '{name}'; give each its own name.")


_Defaults = Mapping[str, Mapping[str, Mapping[str, str]]]
"""Class -> tag -> attribute -> value, nested classes resolved; the outermost class is `main`."""


def _defaults(path: Path, root: Element) -> _Defaults:
    classes: dict[str, Mapping[str, Mapping[str, str]]] = {}
    for name, values in _classes(path, root.find("default"), "main", {}):
        require(name not in classes, f"{path}: two <default> have class '{name}'; give each its own name.")
        classes[name] = values
    return classes


def _classes(
    path: Path, element: Element | None, name: str, outer: Mapping[str, Mapping[str, str]]
) -> Iterator[tuple[str, Mapping[str, Mapping[str, str]]]]:
    inside = [] if element is None else list(element)
    values = {tag: dict(own) for tag, own in outer.items()}
    for child in inside:
        if child.tag != "default":
            values.setdefault(child.tag, {}).update(child.attrib)
    yield name, values
    for child in inside:
        if child.tag == "default":
            require("class" in child.attrib, f"{path}: a nested <default> has no class=; give it one.")
            yield from _classes(path, child, child.attrib["class"], values)


def _resolved(path: Path, element: Element, defaults: _Defaults) -> Mapping[str, str]:
    """The attributes of an element with those of its default class."""
    name = element.get("class", "main")
    require(
        name in defaults, f"{path}: {_called(element)} has class '{name}', which no <default> declares; declare it."
    )
    return {**defaults[name].get(element.tag, {}), **element.attrib}


def _meshes(path: Path, root: Element) -> dict[str, Array]:
    """Mesh -> its corners, (k, 3)."""
    every = root.findall("asset/mesh")
    _check_names(path, "mesh", [mesh.attrib["name"] for mesh in every])
    meshes = [mesh for mesh in every if "face" not in mesh.attrib]
    for mesh in meshes:
        require(
            "file" not in mesh.attrib, f"{path}: {_called(mesh)} has file=, which only a picture has; give its corners."
        )
        require("vertex" in mesh.attrib, f"{path}: {_called(mesh)} has no vertex=; give its corners.")
    corners = {mesh.attrib["name"]: _numbers(mesh.attrib["vertex"]).reshape(-1, 3) for mesh in meshes}
    count = sum(map(len, corners.values()))
    require(
        count <= MOST_CORNERS_IN_ALL,
        f"{path}: the meshes have {count} corners; {MOST_CORNERS_IN_ALL} are the most that a part may have, so cut "
        "round walls that no contact uses into fewer sides.",
    )
    return corners


_NEEDED: Mapping[str, Mapping[str, str]] = {
    "box": {"size": "give half of each side"},
    "cylinder": {"size": "give the radius and half of the length"},
    "mesh": {"mesh": "name one of those in <asset>"},
}
"""Type -> attribute -> what to do where it is missing."""
_OF_TYPE: Mapping[str, tuple[str, ...]] = {
    "box": ("pos", "size"),
    "cylinder": ("pos", "size", "zaxis"),
    "mesh": ("mesh",),
}


def _piece(path: Path, element: Element, attributes: Mapping[str, str], meshes: dict[str, Array]) -> Piece:
    """The piece of a geom; its mesh is taken out of those that are left."""
    name = element.attrib["name"]
    kind = attributes.get("type")
    if kind is None:
        raise InputError(
            f'{path}: {_called(element)} has no type=, which MuJoCo takes for a sphere; say type="box", or another one.'
        )
    for key, words in _NEEDED[kind].items():
        require(key in attributes, f"{path}: {_called(element)} has no {key}=; {words}.")
    for key in ("pos", "size", "zaxis", "mesh"):
        require(
            key not in attributes or key in _OF_TYPE[kind],
            f"{path}: {_called(element)} has {key}=, which a {kind} has not; remove it.",
        )
    at = _numbers(attributes.get("pos", "0 0 0"))
    size = _numbers(attributes.get("size", ""))
    if kind == "mesh":
        require(
            attributes["mesh"] in meshes,
            f"{path}: {_called(element)} has the mesh '{attributes['mesh']}', which <asset> has not, or another "
            "geom has; give each geom its own.",
        )
        return checked_hull(path, name, meshes.pop(attributes["mesh"]))
    require(
        len(size) == (3 if kind == "box" else 2),
        f"{path}: {_called(element)} has {len(size)} numbers in size=; {_NEEDED[kind]['size']}.",
    )
    if kind == "box":
        return Box(name, at, size)
    require(
        size[0] <= WIDEST_M,
        f"{path}: {_called(element)} has a radius of {size[0]:g} m; {WIDEST_M:g} is the most allowed.",
    )
    axis = _numbers(attributes.get("zaxis", "0 0 1"))
    length = float(np.linalg.norm(axis))
    require(length >= _SHORTEST_AXIS, f"{path}: {_called(element)} has a zaxis= of no length; give a direction.")
    return cylinder_hull(name, Cylinder(at, axis / length, float(size[0]), float(size[1])))


def _mark(path: Path, element: Element, attributes: Mapping[str, str]) -> Mark:
    name = element.attrib["name"]
    require(
        not name.startswith("auto_"),
        f"{path}: site '{name}' begins with auto_, which is kept for faces without a name; rename it.",
    )
    return Mark(name, _numbers(attributes.get("pos", "0 0 0")), element.get("class") == _FIT_CLASS)


def _numbers(text: str) -> Array:
    return np.array([float(word) for word in text.split()])


def _called(element: Element) -> str:
    return f"<{element.tag}> '{element.get('name', '')}'"
