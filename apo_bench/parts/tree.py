"""XML read strictly: what the table of a part file does not allow is refused by name, with its line, as it is met."""

from collections import Counter
from pathlib import Path
from typing import NoReturn
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from apo_bench.errors import InputError
from apo_bench.io.ordinary_files import read_text
from apo_bench.parts.allowed import ELEMENT_RULES, LARGEST_PART_BYTES, MOST_CLASSES, REMEDIES, ElementRule

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
