"""Read TOML and JSON files into msgspec types, with errors that state the place and what is needed."""

import json
import re
from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import msgspec
import numpy as np

from apo_bench.errors import InputError, one_line, require
from apo_bench.geometry import Array
from apo_bench.io.safe_io import LARGEST_BYTES, read_text
from apo_bench.io.safe_text import UNSHOWN

Finite = Annotated[float, msgspec.Meta(ge=-1e300, le=1e300)]
"""A number that is neither infinite nor NaN."""
Positive = Annotated[float, msgspec.Meta(gt=0.0, le=1e300)]
NotNegative = Annotated[float, msgspec.Meta(ge=0.0, le=1e300)]
Triple = tuple[Finite, Finite, Finite]
Quadruple = tuple[Finite, Finite, Finite, Finite]
Text = Annotated[str, msgspec.Meta(pattern=f"^(?:(?!{UNSHOWN.pattern})(?s:.)|[\n\t])*$")]
"""A text without control characters."""
Syntax = Literal["toml", "json"]
_LONGEST_VALUE = 60  # letters of a value in a message
# message of msgspec, and the path in the document that may follow it
_PATH = re.compile(r"(.*?)(?: - at `\$(.*)`)?", re.DOTALL)
_STEP = re.compile(r"\.([^.\[]+)|\[(\d+)\]")  # a step of such a path: a key, or an index of a list
_ENTRY = re.compile(r"((?<!i)s)?\[(\d+)\]")  # an index, after the plural `s` of a key, which is dropped
_WORDS = {  # type in a message of msgspec, or kind of JSON value -> words
    "float": "a number",
    "int": "a whole number",
    "str": "a text in quotes",
    "bool": "true or false",
    "array": "a list",
    "object": "a table of named keys",
    "date": "a date",
    "datetime": "a date",
    "time": "a time",
    "null": "nothing",
}


class FileTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A table of a file: its fields are the allowed keys; those without a default are required."""


T = TypeVar("T")


def read_typed(
    path: str | Path,
    wanted: type[T],
    kind: str,
    *,
    syntax: Syntax = "toml",
    limit: int = LARGEST_BYTES,
) -> T:
    """Read a file into a type.

    Args:
        kind: What the file should be, for the message: `sweep file`.
        limit: Largest size in bytes.

    Raises:
        InputError: There is no such file, it is too large, not UTF-8, of another syntax, or not of the type.
    """
    return convert_typed(read_plain(path, kind, syntax=syntax, limit=limit), wanted, str(path))


def read_plain(path: str | Path, kind: str, *, syntax: Syntax = "toml", limit: int = LARGEST_BYTES) -> Any:
    """Read a file into dicts, lists, texts and numbers; arguments as in `read_typed`."""
    return parse_plain(read_text(path, f"{kind} (.{syntax})", limit), str(path), syntax)


def parse_plain(text: str, file: str, syntax: Syntax) -> Any:
    """Parse a text into dicts, lists, texts and numbers; `file` is its name in messages.

    Raises:
        InputError: The text has another syntax.
    """
    decode = msgspec.toml.decode if syntax == "toml" else msgspec.json.decode
    try:
        return decode(text)
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise InputError(f"{file}: this is not {syntax.upper()} ({error}); correct the file at that place.") from error


def convert_typed(value: Any, wanted: type[T], place: str) -> T:
    """Convert a part of a document to a type.

    Args:
        place: File and key of the part, for the message.

    Raises:
        InputError: The type does not allow the value.
    """
    try:
        return msgspec.convert(value, wanted)
    except msgspec.ValidationError as error:
        raise InputError(_describe_fault(str(error), value, wanted, place)) from error


def _describe_fault(said: str, value: Any, wanted: Any, place: str) -> str:
    """Return a message of msgspec as a sentence: `mine.toml, operation 2, goal: a list is needed, 3 was given.`."""
    match = _PATH.fullmatch(said)
    assert match is not None
    fault, named = match[1], match[2] or ""
    path = named.partition("[...]")[0]  # up to the first unknown index
    # find the value that the message is about
    for key, entry in _STEP.findall(path):
        value = value[key] if key else value[int(entry)]
    at = place + _ENTRY.sub(lambda found: f" {int(found[2]) + 1}", re.sub(r"^\[", ".entry[", path)).replace(".", ", ")
    if missing := re.fullmatch(r"Object missing required field `(.*)`", fault):
        return f"{at}: the key '{missing[1]}' is missing."
    if unknown := re.fullmatch(r"Object contains unknown field `(.*)`", fault, re.DOTALL):
        known = [key for table in _list_tables(wanted) for key in table.__struct_encode_fields__]
        near = get_close_matches(unknown[1], known, n=1, cutoff=0.5)
        hint = f" (did you mean '{near[0]}'?)" if near else ""
        return f"{at}: unknown key '{one_line(unknown[1], _LONGEST_VALUE)}'{hint}."
    if not fault.startswith(("Expected", "Invalid", "Number")):
        return f"{at}: {fault}"
    return f"{at}: {_describe_needed(fault, path.rpartition('.')[2], wanted)} is needed, {show_value(value)} was given."


def _describe_needed(fault: str, key: str, wanted: Any) -> str:
    """Return what a type allows, in words."""
    if fault.startswith("Invalid"):
        return " or ".join(map(show_value, _list_choices(wanted, key)))
    if "matching regex" in fault:
        return "a text without control characters"
    needed = re.sub(r", got .*", "", fault).removeprefix("Expected ")
    needed = re.sub(
        r"`(.*?)`", lambda found: " or ".join(_WORDS.get(kind, kind) for kind in found[1].split(" | ")), needed
    )
    return re.sub(r"a number [<>]= -?1e\+300|Number out of range", "a finite number", needed)  # the bounds of `Finite`


def _list_tables(wanted: Any) -> Iterator[type[msgspec.Struct]]:
    """Yield all tables that a type contains."""
    inside = get_args(wanted)
    if isinstance(wanted, type) and issubclass(wanted, msgspec.Struct):
        yield wanted
        inside = tuple(get_type_hints(wanted).values())
    for inner in inside:
        yield from _list_tables(inner)


def _list_choices(wanted: Any, key: str) -> Iterator[Any]:
    """Yield the values that a key of some table may have, if it is a tag or a `Literal`."""
    for table in _list_tables(wanted):
        if table.__struct_config__.tag_field == key:
            yield table.__struct_config__.tag
        hint = get_type_hints(table).get(key)
        for inner in (hint, *get_args(hint)):
            if get_origin(inner) is Literal:
                yield from get_args(inner)


def show_value(value: Any) -> str:
    """Return a value of a document for a sentence, shortened."""
    text = one_line(json.dumps(value, ensure_ascii=False, default=str), _LONGEST_VALUE)
    return text if len(text) < _LONGEST_VALUE else f"{text[: _LONGEST_VALUE - 3]}..."


def check_quaternion(q: Quadruple, place: str) -> Array:
    """Return a quaternion as an array, (4,).

    Raises:
        InputError: Its length is not 1.
    """
    holds = abs(np.linalg.norm(q) - 1.0) <= 1e-3
    require(holds, f"{place}: a quaternion of length 1 (within 0.001) is needed, {show_value(list(q))} was given.")
    return np.array(q, dtype=np.float64)
