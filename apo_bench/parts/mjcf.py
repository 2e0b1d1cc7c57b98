"""A part file: MJCF with one body of named, axis-aligned boxes, and sites that name faces. No simulator needed."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import final
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from apo_bench.errors import InputError
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.solid import Box

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
"""What parts, boxes and faces may be called: names that stay unambiguous in `part.face` and in a scene."""
FIT_CLASS = "fit"
LARGEST_BYTES = 1_000_000
LARGEST_M = 10.0
MOST_BOXES = 100
TURNS = ("quat", "euler", "axisangle", "xyaxes", "zaxis")


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


def read_part(path: Path) -> PartFile:
    """Read a part file.

    Raises:
        InputError: The file cannot be read, is no XML, or is not one body of named, aligned boxes and sites.
    """
    root = _root(path)
    body = _body(path, root)
    defaults = _defaults(path, root)
    elements = [(child, _resolved(path, child, body, defaults)) for child in body]
    boxes = tuple(_box(path, e, a) for e, a in elements if e.tag == "geom")
    marks = tuple(_mark(path, e, a) for e, a in elements if e.tag == "site")
    if not boxes:
        raise InputError(f"{path}: body '{body.get('name', '')}' has no geom; give it at least one named box.")
    if len(boxes) > MOST_BOXES:
        raise InputError(f"{path}: there are {len(boxes)} geoms; a part has at most {MOST_BOXES} boxes.")
    for kind, names in (("geom", [b.name for b in boxes]), ("site", [m.name for m in marks])):
        for name in names:
            if names.count(name) > 1:
                raise InputError(f"{path}: two {kind}s are called '{name}'; give each its own name.")
    return PartFile(path, boxes, marks)


def _root(path: Path) -> Element:
    try:
        if not path.is_file():
            reason = "is a folder" if path.is_dir() else "does not exist"
            raise InputError(f"{path}: the part file {reason}; give the path of an MJCF file or a short name.")
        with path.open("rb") as stream:
            raw = stream.read(LARGEST_BYTES + 1)
        if len(raw) > LARGEST_BYTES:
            raise InputError(f"{path}: the part file is larger than 1 MB; a part is a few named boxes.")
        root = ElementTree.fromstring(raw)
    except ElementTree.ParseError as error:
        raise InputError(f"{path}: not well-formed XML ({error}); mend the file at that place.") from error
    except (OSError, ValueError, LookupError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: the part file cannot be read ({error}); check path, rights and encoding.") from error
    if root.tag != "mujoco":
        raise InputError(f"{path}: the outermost element is <{root.tag}>; a part file begins with <mujoco>.")
    return root


def _body(path: Path, root: Element) -> Element:
    """The one body, which is the frame of the part."""
    if root.find(".//include") is not None:
        raise InputError(f"{path}: <include> is not followed; write the boxes into the file itself.")
    children = [child for world in root.findall("worldbody") for child in world]
    if not children:
        raise InputError(f"{path}: there is no body; put the boxes of the part into one <body> in <worldbody>.")
    for child in children:
        if child.tag != "body":
            raise InputError(f"{path}: {_called(child)} stands outside the body; move it into the <body> of the part.")
    if len(children) > 1:
        raise InputError(f"{path}: there are {len(children)} bodies; a part is one rigid <body>.")
    body = children[0]
    for key in ("pos", *TURNS):
        if _numbers(path, body, key, body.get(key), None).any():
            raise InputError(f"{path}: {_called(body)} has {key}=; remove it, the body is the frame of the part.")
    for child in body:
        if child.tag not in ("geom", "site"):
            raise InputError(
                f"{path}: {_called(child)} is inside the body; only <geom> and <site> are allowed, "
                "the scene adds joints and the density gives the inertia."
            )
    return body


Defaults = Mapping[str, Mapping[str, Mapping[str, str]]]
"""Class -> tag -> attribute -> value, nested classes resolved; the outermost class is `main`."""


def _defaults(path: Path, root: Element) -> Defaults:
    found: dict[str, Mapping[str, Mapping[str, str]]] = {"main": {}}
    for element in root.findall("default"):
        found.update(_classes(path, element, element.get("class", "main"), found["main"]))
        found["main"] = found.get(element.get("class", "main"), {})
    return found


def _classes(
    path: Path, element: Element, name: str, outer: Mapping[str, Mapping[str, str]]
) -> Iterator[tuple[str, Mapping[str, Mapping[str, str]]]]:
    own = {tag: dict(values) for tag, values in outer.items()}
    for child in element:
        if child.tag != "default":
            own.setdefault(child.tag, {}).update(child.attrib)
    yield name, own
    for child in element.findall("default"):
        if "class" not in child.attrib:
            raise InputError(f"{path}: a nested <default> has no class=; give it one.")
        yield from _classes(path, child, child.attrib["class"], own)


def _resolved(path: Path, element: Element, body: Element, defaults: Defaults) -> Mapping[str, str]:
    """The attributes of an element with those of its default class."""
    name = element.get("class") or body.get("childclass") or "main"
    if name not in defaults:
        raise InputError(f"{path}: {_called(element)} has class '{name}', which no <default> declares; declare it.")
    return {**defaults[name].get(element.tag, {}), **element.attrib}


def _box(path: Path, element: Element, attributes: Mapping[str, str]) -> Box:
    name = _name(path, element)
    kind = attributes.get("type", "sphere")
    if kind != "box" or "mesh" in attributes or "fromto" in attributes:
        given = "a mesh" if "mesh" in attributes else "given by fromto" if "fromto" in attributes else f"a {kind}"
        raise InputError(f"{path}: geom '{name}' is {given}; parts are made of boxes (type=\"box\", pos, size).")
    for key in TURNS:
        if key in attributes and not _is_identity(key, _numbers(path, element, key, attributes[key], None)):
            raise InputError(
                f"{path}: geom '{name}' is turned by {key}=; boxes are aligned with the body, "
                "exchange the entries of size= instead."
            )
    half = _numbers(path, element, "size", attributes.get("size"), 3)
    if not (half > 0).all():
        raise InputError(f"{path}: geom '{name}' has size=\"{attributes['size']}\"; every half size must be above 0 m.")
    return Box(name, _numbers(path, element, "pos", attributes.get("pos", "0 0 0"), 3), half)


def _mark(path: Path, element: Element, attributes: Mapping[str, str]) -> Mark:
    name = _name(path, element)
    if name.startswith("auto_"):
        raise InputError(f"{path}: site '{name}' begins with auto_, which is kept for faces without a name; rename it.")
    point = _numbers(path, element, "pos", attributes.get("pos", "0 0 0"), 3)
    return Mark(name, point, element.get("class") == FIT_CLASS)


def _name(path: Path, element: Element) -> str:
    name = element.get("name", "")
    if not name:
        place = " ".join(f'{k}="{v}"' for k, v in element.attrib.items())
        raise InputError(f"{path}: <{element.tag} {place}> has no name; name it, rows and messages use the name.")
    if not NAME.fullmatch(name):
        raise InputError(
            f"{path}: <{element.tag}> is called '{name}'; a name is a letter, then letters, digits and underscores."
        )
    return name


def _numbers(path: Path, element: Element, key: str, text: str | None, count: int | None) -> Array:
    """The numbers of an attribute; none for an absent one, if any count will do."""
    if text is None and count is None:
        return np.zeros(0)
    try:
        values = np.array([float(word) for word in (text or "").split()])
    except ValueError:
        values = np.array([np.nan])
    if count is None and np.isfinite(values).all():
        return values
    if len(values) != count or not (np.abs(values) <= LARGEST_M).all():
        wanted = f"{count} numbers of at most {LARGEST_M:g} m are" if count else "finite numbers are"
        raise InputError(f'{path}: {_called(element)} has {key}="{text or ""}"; {wanted} needed.')
    return values


def _is_identity(key: str, values: Array) -> bool:
    identities = {"quat": (1, 0, 0, 0), "euler": (0, 0, 0), "xyaxes": (1, 0, 0, 0, 1, 0), "zaxis": (0, 0, 1)}
    if key == "axisangle":
        return len(values) == 4 and values[3] == 0
    return tuple(values) == identities[key]


def _called(element: Element) -> str:
    return f"<{element.tag}> '{element.get('name', '')}'"
