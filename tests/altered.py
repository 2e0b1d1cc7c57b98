"""Folders of sweeps, altered: bytes, words, structure, lines, and what stands where a file was."""

from __future__ import annotations

import copy
import json
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

FILES = ("trials.jsonl", "run.json", "timing.jsonl")
WORD = re.compile(rb'"(?:[^"\\]|\\.)*"|-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|true|false|null')
ODD = (
    *(b"NaN", b"-Infinity", b"1e999", b"-1", b"0.5", b"1e300", b"9" * 400, b"9223372036854775808", b"true", b"null"),
    *(b"[]", b"{}", b'""', b'"evil:arm"', b'"os:abort"', b'"../../etc/passwd"', b'"\\u001b[2J"', b'"a\\nb"', b'"=1+1"'),
    *(b'"<script>alert(1)</script>"', b'"$(touch x)"', b'"; rm -r x"', b'"\\ud800"', b'"\\u202e"', b'"[/red]"'),
    *(b'"' + b"x" * 9000 + b'"', b"[" * 3000 + b"]" * 3000, b'{"a":' * 3000 + b"1" + b"}" * 3000, b"'", b",", b""),
)
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, 1, -1, 7, 0.5, -0.5, 1e15, 1e16, 1e-300, 2**53, 2**70, "", "x", "judge", "gap", "full"),
    *("range", "friction", "weld", "all", "oracle", "apo-bench/row/2", "apo-bench/row/99", [], {}, [1], ["a"], [[1]]),
    *(
        {"a": 1},
        {"": {}},
        [None],
        "y" * 300,
        "detected",
        "shifted:3",
        "missed",
        "measured",
        [1, "a"],
        {"fails": True},
    ),
)


def altered(folder: Path, copied: Path, rng: np.random.Generator) -> str:
    """Copy the folder of a sweep and change something of it; what was done."""
    if copied.exists():
        shutil.rmtree(copied)
    shutil.copytree(folder, copied)
    name = str(rng.choice(FILES, p=(0.6, 0.25, 0.15)))
    ways: tuple[Callable[[bytes, np.random.Generator], bytes], ...] = (of_bytes, of_words, of_structure, of_lines)
    way = ways[int(rng.choice(4, p=(0.2, 0.3, 0.4, 0.1)))]
    if rng.random() < 0.03:
        return in_the_way(copied / name, rng)
    text = (copied / name).read_bytes()
    for _ in range(int(rng.integers(1, 4))):
        text = way(text, rng)
    (copied / name).write_bytes(text)
    return f"{way.__name__} of {name}"


def of_bytes(text: bytes, rng: np.random.Generator) -> bytes:
    """Some bytes are lost, changed, added or there twice."""
    at = int(rng.integers(len(text) + 1))
    many = int(rng.integers(1, 9))
    noise = rng.bytes(many)
    ways = (
        text[:at] + text[at + many :],
        text[:at] + noise + text[at + many :],
        text[:at] + noise + text[at:],
        text[:at] + text[at : at + many] + text[at:],
        text[:at],
    )
    return ways[int(rng.integers(len(ways)))]


def of_words(text: bytes, rng: np.random.Generator) -> bytes:
    """A number, text or constant becomes something odd."""
    found = list(WORD.finditer(text))
    if not found:
        return text
    one = found[int(rng.integers(len(found)))]
    return text[: one.start()] + ODD[int(rng.integers(len(ODD)))] + text[one.end() :]


def of_structure(text: bytes, rng: np.random.Generator) -> bytes:
    """In a line, or the whole, a value is lost, replaced, moved, or there under another name."""
    lines = text.splitlines(keepends=True)
    whole = text.lstrip().startswith(b"{\n")
    k = 0 if whole or not lines else int(rng.integers(len(lines)))
    try:
        value = json.loads(text if whole else lines[k])
    except (ValueError, IndexError, RecursionError):
        return text
    places = _places(value)
    if not places:
        return text
    holder, key = places[int(rng.integers(len(places)))]
    other, there = places[int(rng.integers(len(places)))]
    way = int(rng.integers(6))
    if way == 0:
        del holder[key]
    elif way == 1:
        holder[key] = copy.deepcopy(VALUES[int(rng.integers(len(VALUES)))])
    elif way == 2:
        holder[key], other[there] = copy.deepcopy(other[there]), copy.deepcopy(holder[key])
    elif way == 3 and isinstance(holder, dict):
        holder[f"{key}_"] = holder.pop(key)
    elif way == 4 and isinstance(holder[key], (dict, list)):
        holder[key].clear()
    else:
        holder[key] = [holder[key]] * int(rng.integers(1, 4))
    made = json.dumps(value).encode() + b"\n"
    return made if whole else b"".join([*lines[:k], made, *lines[k + 1 :]])


def of_lines(text: bytes, rng: np.random.Generator) -> bytes:
    """Lines are lost, there twice, empty, joined or in another order."""
    lines = text.splitlines(keepends=True)
    if not lines:
        return text
    k = int(rng.integers(len(lines)))
    ways = (
        [*lines[:k], *lines[k + 1 :]],
        [*lines[: k + 1], *lines[k:]],
        [*lines[:k], b"\n", *lines[k:]],
        [*lines[:k], lines[k].rstrip(b"\n"), *lines[k + 1 :]],
        lines[::-1],
        [lines[k]],
    )
    return b"".join(ways[int(rng.integers(len(ways)))])


def in_the_way(path: Path, rng: np.random.Generator) -> str:
    """Something else stands where the file was."""
    path.unlink()
    kinds = ("nothing", "a folder", "a FIFO", "a link to nowhere", "a link to a device", "an empty file")
    kind = str(rng.choice(kinds))
    if kind == "a folder":
        path.mkdir()
    elif kind == "a FIFO":
        os.mkfifo(path)
    elif kind == "a link to nowhere":
        path.symlink_to("nowhere")
    elif kind == "a link to a device":
        path.symlink_to("/dev/zero")
    elif kind == "an empty file":
        path.write_bytes(b"")
    return f"{kind} for {path.name}"


def _places(value: Any) -> list[tuple[Any, Any]]:
    """Every member of every object and list, as holder and key."""
    found: list[tuple[Any, Any]] = []
    left = [value]
    while left:
        holder = left.pop()
        keys = list(holder) if isinstance(holder, dict) else range(len(holder)) if isinstance(holder, list) else ()
        for key in keys:
            found.append((holder, key))
            if isinstance(holder[key], (dict, list)):
                left.append(holder[key])
    return found
