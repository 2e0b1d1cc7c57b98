"""All that a part file may say: which elements, with which attributes, with which values. MuJoCo is told no more."""

import re
from collections.abc import Mapping
from typing import NamedTuple

FACE_OR_PART_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
"""What parts, boxes and faces may be called: names that stay unambiguous in `part.face` and in a scene."""
LONGEST_FACE_NAME = 64
_LARGEST_M = 10.0
THINNEST_M = 0.0005
"""Half of the least thickness of a box or a cylinder."""
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")


class NumbersRule(NamedTuple):
    """Numbers with spaces between them."""

    spans: tuple[tuple[float, float], ...]
    """The least and the largest value of each."""
    least: int
    """The least count of numbers."""
    words: str
    """What is allowed, in words."""
    groups_of: int = 1
    """So many of them belong together."""

    def allows(self, text: str) -> bool:
        # Words as MuJoCo reads them: other alphabets have spaces too, which are letters to it.
        numbers = text.split() if text.isascii() else [text]
        counted = self.least <= len(numbers) <= len(self.spans) and len(numbers) % self.groups_of == 0
        if not counted or not all(map(_NUMBER.fullmatch, numbers)):
            return False
        return all(low <= float(number) <= high for number, (low, high) in zip(numbers, self.spans, strict=False))


class TextRule(NamedTuple):
    """A short text."""

    pattern: re.Pattern[str]
    words: str
    """What is allowed, in words."""

    def allows(self, text: str) -> bool:
        return len(text) <= LONGEST_FACE_NAME and self.pattern.fullmatch(text) is not None


def _numbers(spans: tuple[tuple[float, float], ...], least: int, unit: str = "") -> NumbersRule:
    most = len(spans)
    count = f"{most}" if least == most else f"{least} to {most}"
    values = ", ".join(f"{low:g} to {high:g}" for low, high in dict.fromkeys(spans))
    return NumbersRule(spans, least, f"{count} number{'s' * (most > 1)} of {values}{unit}")


def _one_of(*words: str) -> TextRule:
    return TextRule(re.compile("|".join(words)), " or ".join(f'"{word}"' for word in words))


class ElementRule(NamedTuple):
    """What an element may have."""

    inside: Mapping[str, int]
    """Elements, and how many of each."""
    attributes: Mapping[str, NumbersRule | TextRule]


_NAMED = TextRule(
    FACE_OR_PART_NAME, f"a name is a letter, then letters, digits and underscores, {LONGEST_FACE_NAME} in all at most"
)
_FILE = TextRule(
    re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*\.stl"),
    "the name of an .stl file in the folder of the part, of letters, digits, _ and -,",
)
_POINT = _numbers(((-_LARGEST_M, _LARGEST_M),) * 3, 3, " m")
_HALF_SIZES = _numbers(((THINNEST_M, _LARGEST_M),) * 3, 2, " m")
_DIRECTION = _numbers(((-1.0, 1.0),) * 3, 3)
_COLOR = _numbers((*((0.0, 1.0),) * 3, (0.1, 1.0)), 4)
"""What cannot be seen, a range finder of MuJoCo would not see."""
FRICTION = _numbers(((0.01, 10.0), (0.0, 0.1), (0.0, 0.1)), 1)
_SURFACE: Mapping[str, NumbersRule | TextRule] = {
    "type": _one_of("box", "mesh", "cylinder"),
    "density": _numbers(((1.0, 25_000.0),), 1, " kg/m^3"),
    "friction": FRICTION,
    "rgba": _COLOR,
}
_DOT: Mapping[str, NumbersRule | TextRule] = {
    "size": _numbers(((1e-4, 0.1),) * 3, 1, " m"),
    "group": _one_of(*"012345"),
    "rgba": _COLOR,
}
MOST_BOXES = 100
MOST_PIECES = 2000
MOST_CORNERS = 640
MOST_FACES = 1000
"""Boxes of a part of boxes alone, pieces of any other, corners of a piece, faces of any part."""
MOST_CORNERS_IN_ALL = 40_000
WIDEST_M = 0.1
"""Corners of all pieces of a part; radius of a cylinder, which is cut into sides."""
LIGHTEST_KG = 1e-4
HEAVIEST_KG = 1e6
MOST_SITES = 600
MOST_CLASSES = 20
LARGEST_PART_BYTES = 4_000_000
"""Of a part file."""
_CORNERS = NumbersRule(
    ((-_LARGEST_M, _LARGEST_M),) * 3 * MOST_CORNERS,
    12,
    f"4 to {MOST_CORNERS} corners of three numbers of {-_LARGEST_M:g} to {_LARGEST_M:g} m each",
    groups_of=3,
)
_DEFAULTS = {"geom": 1, "site": 1, "default": MOST_CLASSES}
ELEMENT_RULES: Mapping[str, ElementRule] = {
    "mujoco": ElementRule({"default": 1, "asset": 1, "worldbody": 1}, {"model": _NAMED}),
    "mujoco/default": ElementRule(_DEFAULTS, {"class": _one_of("main")}),
    "default/default": ElementRule(_DEFAULTS, {"class": _NAMED}),
    "default/geom": ElementRule({}, _SURFACE),
    "default/site": ElementRule({}, _DOT),
    "mujoco/asset": ElementRule({"mesh": MOST_PIECES + 1}, {}),
    "asset/mesh": ElementRule({}, {"name": _NAMED, "vertex": _CORNERS, "file": _FILE}),
    "mujoco/worldbody": ElementRule({"body": 1}, {}),
    "worldbody/body": ElementRule({"geom": MOST_PIECES + 1, "site": MOST_SITES}, {"name": _NAMED}),
    "body/geom": ElementRule(
        {},
        {
            "name": _NAMED,
            "class": _NAMED,
            "pos": _POINT,
            "size": _HALF_SIZES,
            "zaxis": _DIRECTION,
            "mesh": _NAMED,
            "contype": _one_of("0"),
            "conaffinity": _one_of("0"),
            "group": _one_of("1"),
            **_SURFACE,
        },
    ),
    "body/site": ElementRule({}, {"name": _NAMED, "class": _NAMED, "pos": _POINT, **_DOT}),
}
"""Element, behind the one that it stands in -> what it may have."""
REMEDIES: Mapping[str, str] = {
    "include": "write the boxes into the file itself",
    "body": "a part is one rigid <body>",
    "joint": "the scene adds joints",
    "freejoint": "the scene adds joints",
    "inertial": "the density gives the inertia",
    "mass": "the density gives the mass",
    "option": "the scene says how it is simulated",
    "compiler": "lengths are in metres",
    "face": "a piece is convex, its corners (vertex=) say all",
    "fromto": "say where with pos=, zaxis= and size=",
    "type": "pieces are boxes (pos, size), cylinders (pos, size, zaxis) and meshes (mesh)",
    **dict.fromkeys(
        ("quat", "euler", "axisangle", "xyaxes"),
        "boxes are aligned with the body (exchange the entries of size= instead), cylinders turned by zaxis=",
    ),
}
"""What to do instead, of elements and attributes that people often try."""
