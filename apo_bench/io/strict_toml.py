"""TOML read strictly: every complaint is one sentence that names the file and the line or the key."""

import re
import tomllib
from pathlib import Path

from apo_bench.errors import InputError
from apo_bench.io.reading import decoded, read_bytes
from apo_bench.io.strict_json import DEEPEST, JsonNode, check_plain

_PART = r"""(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
_LONG_KEY = re.compile(rf"(?<![\w.-]){_PART}(?:[ \t]*+\.[ \t]*+{_PART}){{{DEEPEST}}}")
"""More names with dots between them than any key has; the time to read such keys grows with their square."""


def read_toml(path: str | Path, kind: str) -> JsonNode:
    """The document in a file.

    Args:
        kind: What the file should be, for the message: `sweep file`.

    Raises:
        InputError: No such file, too large, not UTF-8, not TOML, nested too deep, a huge number, or a date or time.
    """
    return parse_toml(read_bytes(path, f"{kind} (.toml)"), str(path))


def parse_toml(raw: bytes, file: str) -> JsonNode:
    """The document in a text; `file` is its name in messages."""
    text = decoded(raw, file, "TOML file")
    if found := _LONG_KEY.search(text):
        line = text.count("\n", 0, found.start()) + 1
        raise InputError(f"{file}, line {line}: at most {DEEPEST} names with dots between them are allowed.")
    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        what = str(error) if isinstance(error, tomllib.TOMLDecodeError) else "nested too deep, or a huge number"
        raise InputError(f"{file}: this is not TOML: {what}; mend the file at that place.") from error
    check_plain(document, file)
    return JsonNode(document, file)
