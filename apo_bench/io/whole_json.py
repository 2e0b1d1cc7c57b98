"""JSON of which nothing is lost when it is read: no key stands twice in an object, no text has half a letter."""

import json
import math
import re
from collections import Counter
from collections.abc import Callable
from typing import Any, Never

import msgspec

from apo_bench.errors import InputError, require
from apo_bench.io.safe_text import clean

HALF_LETTER = re.compile("[\ud800-\udfff]")
"""Half a letter, such as a lone \\ud800, which no file can hold as UTF-8."""
HALF_BUT_OF_FILES = re.compile("[\ud800-\udc7f\udd00-\udfff]")
"""Half letters, but for those that stand for bytes in names of files which are not UTF-8."""
WHOLE_LETTERS = "text without half letters (a lone \\ud800 to \\udfff) is needed"
_LONGEST_KEY = 60


def is_whole(text: bytes) -> bool:
    """Surely so: nothing is escaped, and as many colons come back when it is read and written again; fast."""
    return b"\\" not in text and text.count(b":") == msgspec.json.encode(msgspec.json.decode(text)).count(b":")


def read_whole(text: bytes, where: str, half: re.Pattern[str]) -> Any:
    """The document, read by the library of the language, which is slower and sees every key.

    Args:
        where: File and line, for the complaint.
        half: `HALF_LETTER` or `HALF_BUT_OF_FILES`.

    Raises:
        InputError: A key stands twice, or a text has half a letter.
        ValueError: It is no JSON.
    """

    def refuse(constant: str) -> Never:
        raise ValueError(constant)

    def finite(number: str) -> float:
        return x if math.isfinite(x := float(number)) else refuse(number)

    hook = unique_members(where)
    document = json.loads(text.decode(), object_pairs_hook=hook, parse_constant=refuse, parse_float=finite)
    field = half_letter(document, half)
    require(field is None, f"{where}, field {field}: {WHOLE_LETTERS}; remove it, or the folder.")
    return document


def unique_members(where: str) -> Callable[[list[tuple[str, Any]]], dict[str, Any]]:
    """What makes an object of its members for `json.loads`; a key that stands twice is an `InputError`."""

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        members = dict(pairs)
        if len(members) < len(pairs):
            twice = clean(Counter(key for key, _ in pairs).most_common(1)[0][0])[:_LONGEST_KEY]
            raise InputError(f"{where}: the key '{twice}' stands twice in one object; keep one of the two.")
        return members

    return unique


def half_letter(value: Any, half: re.Pattern[str], field: str = "") -> str | None:
    """The first field of a document with half a letter in its name or text, such as `tried[0].step`."""
    if isinstance(value, str):
        return field if half.search(value) else None
    inside: list[tuple[str, Any]] = []
    if isinstance(value, list):
        inside = [(f"{field}[{i}]", entry) for i, entry in enumerate(value)]
    if isinstance(value, dict):
        for name, entry in value.items():
            place = f"{field}.{clean(name)[:_LONGEST_KEY]}".lstrip(".")
            inside += [(place, name), (place, entry)]
    places = (half_letter(entry, half, place) for place, entry in inside)
    return next((place for place in places if place is not None), None)
