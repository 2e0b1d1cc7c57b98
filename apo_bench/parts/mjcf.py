"""A part file: MJCF with one body of named, axis-aligned boxes, and sites that name faces. No simulator needed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import final
from xml.etree.ElementTree import Element, tostring

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.solid import Box
from apo_bench.parts.tree import read_tree

_FIT_CLASS = "fit"
_DENSITY = 1000.0
"""[kg/m^3], where none is stated."""


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
    boxes: tuple[Box, ...]
    marks: tuple[Mark, ...]
    density: float
    """[kg/m^3]."""
    xml: str
    """The part as MJCF, written anew: all that a simulator may be told of it."""


def read_part(path: Path) -> PartFile:
    """Read a part file.

    Raises:
        InputError: The file cannot be read, is no XML, or is not one body of named, aligned boxes and sites.
    """
    root = read_tree(path)
    body = root.find("worldbody/body")
    if body is None:
        raise InputError(f"{path}: there is no body; put the boxes of the part into one <body> in <worldbody>.")
    defaults = _defaults(path, root)
    elements = [(child, _resolved(path, child, defaults)) for child in body]
    geoms = [(_box(path, e, a), a) for e, a in elements if e.tag == "geom"]
    marks = tuple(_mark(path, e, a) for e, a in elements if e.tag == "site")
    if not geoms:
        raise InputError(f"{path}: body '{body.get('name', '')}' has no geom; give it at least one named box.")
    _check_names(path, "geom", [box.name for box, _ in geoms])
    _check_names(path, "site", [mark.name for mark in marks])
    densities = sorted({float(said.get("density", _DENSITY)) for _, said in geoms})
    if len(densities) > 1:
        raise InputError(
            f"{path}: the geoms have densities from {densities[0]:g} to {densities[-1]:g} kg/m^3; a part has one."
        )
    return PartFile(path, tuple(box for box, _ in geoms), marks, densities[0], tostring(root, encoding="unicode"))


def _check_names(path: Path, kind: str, names: list[str]) -> None:
    name, count = max(Counter(names).items(), key=lambda item: item[1], default=("", 0))
    if count > 1:
        raise InputError(f"{path}: two {kind}s are called '{name}'; give each its own name.")


_Defaults = Mapping[str, Mapping[str, Mapping[str, str]]]
"""Class -> tag -> attribute -> value, nested classes resolved; the outermost class is `main`."""


def _defaults(path: Path, root: Element) -> _Defaults:
    found: dict[str, Mapping[str, Mapping[str, str]]] = {}
    for name, said in _classes(path, root.find("default"), "main", {}):
        if name in found:
            raise InputError(f"{path}: two <default> have class '{name}'; give each its own name.")
        found[name] = said
    return found


def _classes(
    path: Path, element: Element | None, name: str, outer: Mapping[str, Mapping[str, str]]
) -> Iterator[tuple[str, Mapping[str, Mapping[str, str]]]]:
    inside = [] if element is None else list(element)
    said = {tag: dict(values) for tag, values in outer.items()}
    for child in inside:
        if child.tag != "default":
            said.setdefault(child.tag, {}).update(child.attrib)
    yield name, said
    for child in inside:
        if child.tag == "default":
            if "class" not in child.attrib:
                raise InputError(f"{path}: a nested <default> has no class=; give it one.")
            yield from _classes(path, child, child.attrib["class"], said)


def _resolved(path: Path, element: Element, defaults: _Defaults) -> Mapping[str, str]:
    """The attributes of an element with those of its default class."""
    name = element.get("class", "main")
    if name not in defaults:
        raise InputError(f"{path}: {_called(element)} has class '{name}', which no <default> declares; declare it.")
    return {**defaults[name].get(element.tag, {}), **element.attrib}


def _box(path: Path, element: Element, said: Mapping[str, str]) -> Box:
    for key, words in (("type", 'which MuJoCo takes for a sphere; say type="box"'), ("size", "give half of each side")):
        if key not in said:
            raise InputError(f"{path}: {_called(element)} has no {key}=; {words}.")
    return Box(element.attrib["name"], _numbers(said.get("pos", "0 0 0")), _numbers(said["size"]))


def _mark(path: Path, element: Element, said: Mapping[str, str]) -> Mark:
    name = element.attrib["name"]
    if name.startswith("auto_"):
        raise InputError(f"{path}: site '{name}' begins with auto_, which is kept for faces without a name; rename it.")
    return Mark(name, _numbers(said.get("pos", "0 0 0")), element.get("class") == _FIT_CLASS)


def _numbers(text: str) -> Array:
    return np.array([float(word) for word in text.split()])


def _called(element: Element) -> str:
    return f"<{element.tag}> '{element.get('name', '')}'"
