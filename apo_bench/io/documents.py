"""JSON and TOML read strictly: every complaint is one sentence that names the file and the line or the key.

JSON of which nothing is lost when it is read: no key stands twice in an object, and no text has half a letter.
"""

from __future__ import annotations

import json
import math
import re
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Never, NoReturn, final

import msgspec
import numpy as np

from apo_bench.errors import InputError, one_line, require
from apo_bench.geometry import Array
from apo_bench.io.ordinary_files import LARGEST_BYTES, decoded, read_bytes, read_text
from apo_bench.io.words import UNSHOWN, clean

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


DEEPEST_NESTING = 32
"""Levels of nesting; no file of ours has more than 6."""
_LARGEST_INTEGER = 10**308
"""Larger ones are no floating-point numbers."""
_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_LONG_KEY = re.compile(rf"(?<![\w.-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{DEEPEST_NESTING}}}")
"""More names with dots between them than any key has; the time to read such keys grows with their square."""


@final
@dataclass(frozen=True)
class JsonNode:
    """A value of a JSON document and where it stands in it."""

    value: Any
    file: str
    key: str = ""
    """From the root, such as `operation 2, position_mm`; empty for the document itself."""

    @property
    def place(self) -> str:
        """File and key, for messages."""
        return f"{self.file}, {self.key}" if self.key else self.file

    def fail(self, allowed: str, remedy: str = "") -> NoReturn:
        """Raise the `InputError` that says what stands here and what is allowed instead."""
        raise InputError(f"{self.place}: {allowed}, {_short(self.value)} was given{f'; {remedy}' if remedy else ''}.")

    def require(self, holds: object, allowed: str, remedy: str = "") -> None:
        """Raise that error unless something holds."""
        if not holds:
            self.fail(allowed, remedy)

    def child(self, value: Any, key: str) -> JsonNode:
        name = one_line(key, 60)
        return JsonNode(value, self.file, f"{self.key}, {name}" if self.key else name)

    def fields(self, required: Iterable[str], optional: Iterable[str] = ()) -> Mapping[str, JsonNode]:
        """The members of an object: every required key, no unknown one."""
        required = tuple(required)
        known = (*required, *optional)
        self.require(
            isinstance(self.value, dict), "an object with named keys is needed", f"its keys are {', '.join(known)}"
        )
        for key in self.value:
            if key not in known:
                near = get_close_matches(key, known, n=1, cutoff=0.5)
                hint = f"; did you mean '{near[0]}'? Allowed" if near else "; allowed"
                raise InputError(f"{self.place}: unknown key '{one_line(key, 60)}'{hint}: {', '.join(known)}.")
        for key in required:
            require(key in self.value, f"{self.place}: the key '{key}' is missing; needed are {', '.join(required)}.")
        return {key: self.child(value, key) for key, value in self.value.items()}

    def fields_of(self, schema: str, required: Iterable[str], optional: Iterable[str] = ()) -> Mapping[str, JsonNode]:
        """The members of an object whose key `schema` names its format; another format is refused before its keys."""
        if isinstance(self.value, dict) and self.value.get("schema", schema) != schema:
            self.child(self.value["schema"], "schema").fail(f'"{schema}" is needed')
        return self.fields(("schema", *required), optional)

    def items(self, name: str, count: int | None = None) -> Sequence[JsonNode]:
        """The entries of a list, called `name 1`, `name 2`, ...; `count` of them if that is given.

        A text in place of a list is its one entry.
        """
        values = [self.value] if isinstance(self.value, str) else self.value
        self.require(isinstance(values, list), "a list is needed")
        require(
            count is None or len(values) == count,
            f"{self.file}, {self.key}: {count} entries are needed, {len(values)} were given.",
        )
        return [JsonNode(value, self.file, f"{name} {i}") for i, value in enumerate(values, start=1)]

    def numbers(self, *shape: int) -> Array:
        """Finite numbers in nested lists of this shape."""
        array = np.array(self.value if _fits(self.value, shape) else math.nan, dtype=np.float64)
        self.require(np.isfinite(array).all(), f"{' x '.join(map(str, shape))} finite numbers are needed")
        return array

    def quaternion(self) -> Array:
        """Four numbers of length 1, w first."""
        q = self.numbers(4)
        self.require(
            abs(np.linalg.norm(q) - 1.0) <= 1e-3,
            "a quaternion of length 1 (within 0.001) is needed",
            "divide it by its length",
        )
        return q

    def number(self, low: float, high: float = math.inf, *, above: bool = False) -> float:
        """A finite number that is at least `low`, or above it, and at most `high`."""
        most = f" to {high:g}" if math.isfinite(high) else ""
        x = float(self.value) if _fits(self.value, ()) else math.nan
        self.require(
            math.isfinite(x) and (low < x if above else low <= x) and x <= high,
            f"a finite number {'above' if above else 'from'} {low:g}{most} is needed",
        )
        return x

    def integer(self) -> int:
        self.require(isinstance(self.value, int) and not isinstance(self.value, bool), "a whole number is needed")
        return self.value

    def text(self) -> str:
        self.require(isinstance(self.value, str), "a text in quotes is needed")
        self.require(
            not UNSHOWN.search(self.value.replace("\n", " ").replace("\t", " ")),
            "a text without control characters is needed",
        )
        return self.value

    def flag(self) -> bool:
        self.require(isinstance(self.value, bool), "true or false is needed")
        return self.value


def read_json(path: str | Path) -> JsonNode:
    """The document in a file.

    Raises:
        InputError: No such file, too large, not UTF-8, not JSON, a repeated key, NaN or Infinity.
    """
    return parse_json(read_text(path, "JSON file"), str(path))


def parse_json(text: str, file: str) -> JsonNode:
    """The document in a text; `file` is its name in messages."""

    def refuse(constant: str) -> NoReturn:
        raise InputError(f"{file}: every number must be finite, {constant} was given.")

    try:
        document = json.loads(text, object_pairs_hook=unique_members(file), parse_constant=refuse)
    except InputError:
        raise
    except json.JSONDecodeError as error:
        raise InputError(f"{file}, line {error.lineno}: this is not JSON ({error.msg}).") from error
    except (RecursionError, ValueError) as error:
        raise InputError(
            f"{file}: this is not a JSON document that can be read (nested too deep, or a huge number)."
        ) from error
    return _plain(JsonNode(document, file))


def read_toml(path: str | Path, kind: str, limit: int = LARGEST_BYTES) -> JsonNode:
    """The document in a file.

    Args:
        kind: What the file should be, for the message: `sweep file`.
        limit: Bytes.

    Raises:
        InputError: No such file, too large, not UTF-8, not TOML, nested too deep, a huge number, or a date or time.
    """
    return parse_toml(read_bytes(path, f"{kind} (.toml)", limit), str(path))


def parse_toml(raw: bytes, file: str) -> JsonNode:
    """The document in a text; `file` is its name in messages."""
    text = decoded(raw, file, "TOML file")
    if match := _LONG_KEY.search(text):
        line = text.count("\n", 0, match.start()) + 1
        raise InputError(f"{file}, line {line}: at most {DEEPEST_NESTING} names with dots between them are allowed.")
    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        what = str(error) if isinstance(error, tomllib.TOMLDecodeError) else "nested too deep, or a huge number"
        raise InputError(f"{file}: this is not TOML: {what}; mend the file at that place.") from error
    return _plain(JsonNode(document, file))


def _plain(document: JsonNode) -> JsonNode:
    """A document; raise an `InputError` if it is nested too deep or holds a huge number, a date or a time."""
    level = [document]
    for _ in range(DEEPEST_NESTING):
        below: list[JsonNode] = []
        for node in level:
            value = node.value
            if isinstance(value, dict):
                below += [node.child(entry, name) for name, entry in value.items()]
            elif isinstance(value, list):
                below += [JsonNode(entry, node.file, node.key) for entry in value]
            elif isinstance(value, int):
                holds = -_LARGEST_INTEGER <= value <= _LARGEST_INTEGER
                require(holds, f"{node.place}: whole numbers go to 1e308, a larger one was given.")
            elif not isinstance(value, str | float | None):
                raise InputError(
                    f"{node.place}: the date or time {value} was given, which no key takes; put it into quotes."
                )
        if not below:
            return document
        level = below
    raise InputError(
        f"{document.file}: the document is nested more than {DEEPEST_NESTING} levels deep; no file of ours is."
    )


def _fits(value: Any, shape: tuple[int, ...]) -> bool:
    if not shape:
        return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300
    return isinstance(value, list) and len(value) == shape[0] and all(_fits(entry, shape[1:]) for entry in value)


def _short(value: Any) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 60 else text[:57] + "..."
