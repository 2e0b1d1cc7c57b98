"""All that a part file may say: which elements, with which attributes, with which values. MuJoCo is told no more.

XML read strictly: what the table of a part file does not allow is refused by name, with its line, as it is met.
"""

import re
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple, NoReturn
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from apo_bench.errors import InputError
from apo_bench.io import read_text

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
"""Of a part file, and of the file beside it."""
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


_DEEPEST = 8
"""Levels of nesting; classes stand in classes, all else at most four levels deep."""


def read_tree(path: Path) -> Element:
    """The outermost element of a part file, with all below it: elements and attributes, and nothing else.

    Raises:
        InputError: The file cannot be read, is no XML, or says something that a part may not say.
    """
    text = read_text(path, "part file", LARGEST_PART_BYTES)
    reader = _Reader(path)
    try:
        reader.parser.Parse(text.encode(), True)
    except expat.ExpatError as error:
        raise InputError(f"{path}: not well-formed XML ({error}); mend the file at that place.") from error
    return reader.builder.close()


class _Reader:
    """Checks and builds the tree while the parser reads."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.builder = TreeBuilder()
        self.parser = expat.ParserCreate("utf-8")
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text
        self.parser.StartDoctypeDeclHandler = self._doctype
        self.parser.ProcessingInstructionHandler = self._instruction
        self._open: list[tuple[str, ElementRule, Counter[str]]] = []
        """Every element that has begun: its tag, what it may have, and how many elements it had of each tag."""
        self._classes = 0

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        allowed = self._known(tag)
        called = f"<{tag}> '{attributes['name'][:60]}'" if "name" in attributes else f"<{tag}>"
        for key, text in attributes.items():
            if key not in allowed.attributes:
                listed = ", ".join(allowed.attributes) or "no attributes"
                self._refuse(f"{called} has {key[:60]}=, which a part may not say; allowed are {listed}", key)
            if not allowed.attributes[key].allows(text):
                self._refuse(f'{called} has {key}="{text[:60]}"; {allowed.attributes[key].words} is allowed', key)
        if "name" in allowed.attributes and "name" not in attributes and tag != "body":
            place = " ".join(f'{k}="{v[:60]}"' for k, v in attributes.items())
            self._refuse(f"<{tag} {place}> has no name; name it, rows and messages use the name")
        self._open.append((tag, allowed, Counter()))
        self.builder.start(tag, attributes)

    def _known(self, tag: str) -> ElementRule:
        """What an element may have that begins here."""
        if not self._open:
            if tag != "mujoco":
                self._refuse(f"the outermost element is <{tag[:60]}>; a part file begins with <mujoco>")
            return ELEMENT_RULES["mujoco"]
        outer, around, had = self._open[-1]
        if tag not in around.inside:
            listed = ", ".join(f"<{name}>" for name in around.inside) or "no elements"
            self._refuse(f"<{tag[:60]}> stands in <{outer}>, which a part may not say; allowed are {listed}", tag)
        had[tag] += 1
        if had[tag] > around.inside[tag]:
            self._refuse(f"<{outer}> has more than {around.inside[tag]} <{tag}>, which is the most it may have", tag)
        self._classes += tag == "default"
        if self._classes > MOST_CLASSES or len(self._open) == _DEEPEST:
            self._refuse(f"at most {MOST_CLASSES} <default>, {_DEEPEST - 1} of them in each other, are allowed")
        return ELEMENT_RULES[f"{outer}/{tag}"]

    def _end(self, tag: str) -> None:
        self._open.pop()
        self.builder.end(tag)

    def _text(self, text: str) -> None:
        if text.strip():
            self._refuse(f"the text '{text.strip()[:60]}' stands between elements; remove it")

    def _doctype(self, *_: object) -> None:
        self._refuse("<!DOCTYPE> is given, which a part may not say; remove it, with all that it declares")

    def _instruction(self, target: str, _: str) -> None:
        self._refuse(f"<?{target[:60]}?> is given, which a part may not say; remove it")

    def _refuse(self, sentence: str, name: str = "") -> NoReturn:
        remedy = f"; {REMEDIES[name]}" if name in REMEDIES else ""
        raise InputError(f"{self.path}, line {self.parser.CurrentLineNumber}: {sentence}{remedy}.")
