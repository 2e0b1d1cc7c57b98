"""Valid files made wrong: byte by byte, token by token, or in their structure; all chance comes from a generator."""

from __future__ import annotations

import csv
import io
import json
import re
import sys
import tomllib
from collections.abc import Callable
from typing import Any
from xml.etree import ElementTree

import numpy as np

from benchmarks.fuzz_binary import by_stl, by_zip

Chance = np.random.Generator
RAN = "code that a file names was run"
NASTY = (
    *(
        "",
        "0",
        "-0",
        "-1",
        "1",
        "1e308",
        "-1e308",
        "1e-320",
        "1e999",
        "nan",
        "inf",
        "-inf",
        "9" * 400,
        "0x" + "f" * 5000,
    ),
    *(
        "true",
        "null",
        "[]",
        "{}",
        '""',
        "1_0",
        "1,2",
        "1 2 3",
        "١",
        "0.1.2",
        "1979-05-27",
        "é",
        "\u202e",
        "\ud83d\ude00",
    ),
    *(
        "fifo",
        "/dev/zero",
        "/dev/stdin",
        "/proc/self/mem",
        "../../etc/passwd",
        ".",
        "/",
        "CON",
        "benchmarks.fuzz_mutate:named",
        "evil:arm",
        "a" * 5000,
    ),
    *(
        "=1+1",
        "<script>alert(1)</script>",
        "$(touch x)",
        "`id`",
        "\x1b[2J",
        "\0",
        "\r",
        "\n",
        "\t",
        "%s%n",
        "{0}",
        "\\",
        '"',
        "'",
    ),
)
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 2**31, 2**63, 2**64, 10**400, 0.5, -0.0, 1e308, 5e-324, float("nan"), float("inf")),
    *([], {}, "", "x", [[]], [0], [0, 0, 0], {"x": 1}, ["x"] * 50, *NASTY),
)
TAGS = (
    "option",
    "compiler",
    "geom",
    "site",
    "body",
    "joint",
    "freejoint",
    "default",
    "include",
    "mesh",
    "plugin",
    "a/b",
)
LARGE = (
    '<include file="fifo"/>',
    '<include file="/dev/zero"/>',
    '<replicate count="1000000"><geom size=".01"/></replicate>',
    '<replicate count="9"><replicate count="9999"><body><geom size=".01"/></body></replicate></replicate>',
    '<flexcomp name="x" type="grid" count="300 300 9" spacing=".1 .1 .1" radius=".01" dim="3"/>',
    '<asset><hfield name="x" nrow="60000" ncol="60000" size="1 1 1 1"/></asset>',
    '<asset><mesh name="x" file="/dev/zero"/></asset>',
    '<asset><texture name="x" type="2d" builtin="flat" width="60000" height="60000"/></asset>',
    '<body mocap="true"><geom size=".01"/></body>',
    '<body><freejoint/><geom size=".01"/></body>',
    '<body><geom size=".01" mass="1e9" friction="1e6"/></body>',
    '<composite type="cable" count="99999 1 1" size="1"><geom size=".01"/></composite>',
    '<size memory="100G" nuserdata="1000000000"/>',
    '<option timestep="1e-9" margin="1" solver="PGS" iterations="1000000000"/>',
    '<equality><weld body1="base" body2="world"/></equality>',
    '<default><material name="x"/></default>',
    '<extension><plugin plugin="mujoco.elasticity.cable"/></extension>',
)
"""Elements of MJCF that wait, grow, or hold something fast."""
KEYS = (
    "gravity",
    "mass",
    "density",
    "friction",
    "contype",
    "margin",
    "quat",
    "class",
    "name",
    "type",
    "size",
    "file",
    "pos",
)
BYTES = (
    b"\0",
    b"\xff",
    b"\xef\xbb\xbf",
    b"\xc3",
    b"\x1b[31m",
    b"\r",
    b"\r\n",
    b"\x85",
    b"\xe2\x80\xa8",
    b"\xed\xa0\x80",
    b"\n" * 200,
)
TOKEN = re.compile(rb"[A-Za-z_][\w-]*|[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?|\s+|.", re.DOTALL)


def named(*_: object) -> None:
    """Code that files name; a sweep or a replay may run it, a report or a comparison may not."""
    print(RAN, file=sys.stderr, flush=True)


def mutated(
    raw: bytes, suffix: str, rng: Chance, structure: Callable[[bytes, Chance], bytes] | None = None
) -> tuple[str, bytes]:
    """The level and the file, changed in one to four places.

    Args:
        structure: How its structure is changed; None: as its ending says.
    """
    levels: tuple[tuple[str, Callable[[bytes, Chance], bytes]], ...] = (
        ("bytes", by_bytes),
        ("tokens", by_tokens),
        ("structure", structure or STRUCTURES[suffix]),
    )
    level, change = levels[int(rng.integers(len(levels)))]
    for _ in range(int(rng.choice([1, 2, 3, 4], p=[0.6, 0.2, 0.1, 0.1]))):
        try:
            raw = change(raw, rng)
        except Exception:  # no longer a document to whatever reader was asked: changed as bytes
            raw = by_bytes(raw, rng)
    return level, raw


def by_bytes(raw: bytes, rng: Chance) -> bytes:
    """One span of bytes replaced, removed, repeated or moved."""
    if not raw:
        return bytes(rng.integers(0, 256, 9, dtype=np.uint8))
    i, j = sorted(int(x) for x in rng.integers(0, len(raw) + 1, 2))
    j = min(j, i + int(rng.choice([1, 2, 8, 64, 4096])))
    kind = int(rng.integers(7))
    if kind == 0:
        return raw[:i] + bytes([int(rng.integers(256))]) + raw[i + 1 :]
    if kind == 1:
        return raw[:i] + raw[j:]
    if kind == 2:
        return raw[:i] + raw[i:j] * int(rng.integers(2, 20)) + raw[j:]
    if kind == 3:
        return raw[:i] + BYTES[int(rng.integers(len(BYTES)))] + raw[i:]
    if kind == 4:
        return raw[:i]
    if kind == 5:
        at = int(rng.integers(len(raw) + 1))
        return raw[:at] + raw[i:j] + raw[at:]
    return raw[:i] + bytes([raw[min(i, len(raw) - 1)] ^ (1 << int(rng.integers(8)))]) + raw[i + 1 :]


def by_tokens(raw: bytes, rng: Chance) -> bytes:
    """One word, number or sign replaced, removed, repeated or exchanged with another."""
    tokens = TOKEN.findall(raw) or [b"x"]
    i, j = (int(x) for x in rng.integers(0, len(tokens), 2))
    kind = int(rng.integers(5))
    if kind == 0:
        tokens[i] = b""
    elif kind == 1:
        tokens[i] *= int(rng.integers(2, 50))
    elif kind == 2:
        tokens[i], tokens[j] = tokens[j], tokens[i]
    elif kind == 3:
        tokens[i] = tokens[j]
    else:
        words = [k for k, token in enumerate(tokens) if token[:1].isalnum() or token[:1] in b"+-"] or [0]
        tokens[words[int(rng.integers(len(words)))]] = _nasty(rng).encode("utf-8", "surrogatepass")
    return b"".join(tokens)


def by_json(raw: bytes, rng: Chance) -> bytes:
    """One value of a document replaced, removed, repeated, renamed, nested or grown."""
    return json.dumps(_changed(json.loads(raw), rng)).encode()


def by_lines(raw: bytes, rng: Chance) -> bytes:
    """The same in one line of many; or lines repeated or exchanged."""
    lines = raw.splitlines(keepends=True)
    i, j = (int(x) for x in rng.integers(0, len(lines), 2))
    kind = int(rng.integers(6))
    if kind == 0:
        lines.insert(j, lines[i])
    elif kind == 1:
        del lines[i]
    else:
        lines[i] = by_json(lines[i], rng) + b"\n"
    return b"".join(lines)


def by_toml(raw: bytes, rng: Chance) -> bytes:
    """The same in a TOML document, written with inline tables."""
    document = _changed(tomllib.loads(raw.decode()), rng)
    if not isinstance(document, dict):
        raise ValueError("no document")
    return "".join(f"{_key(key)} = {_toml(value)}\n" for key, value in document.items()).encode("utf-8", "replace")


def by_csv(raw: bytes, rng: Chance) -> bytes:
    """One cell, row or column replaced, removed, repeated or exchanged."""
    rows = list(csv.reader(io.StringIO(raw.decode(), newline="")))
    i, j = (int(x) for x in rng.integers(0, len(rows), 2))
    a, b = (int(x) for x in rng.integers(0, len(rows[i]), 2))
    kind = int(rng.integers(6))
    if kind == 0:
        rows[i][a] = _nasty(rng)
    elif kind == 1:
        del rows[i]
    elif kind == 2:
        rows.insert(j, list(rows[i]))
    elif kind == 3:
        rows[i][a], rows[i][b] = rows[i][b], rows[i][a]
    elif kind == 4:
        rows = [row[:a] + row[a + 1 :] for row in rows]
    else:
        rows = [[*row, *row[a : a + 1]] for row in rows]
    out = io.StringIO()
    csv.writer(out, lineterminator="\n", quoting=csv.QUOTE_MINIMAL, escapechar="\\").writerows(rows)
    return out.getvalue().encode("utf-8", "replace")


def by_xml(raw: bytes, rng: Chance) -> bytes:
    """One element or attribute replaced, removed, repeated, moved or added."""
    root = ElementTree.fromstring(raw)
    elements = list(root.iter())
    one, other = (elements[int(k)] for k in rng.integers(0, len(elements), 2))
    kind = int(rng.integers(7))
    if kind == 0:
        one.set(KEYS[int(rng.integers(len(KEYS)))], _nasty(rng))
    elif kind == 1 and one.attrib:
        del one.attrib[list(one.attrib)[int(rng.integers(len(one.attrib)))]]
    elif kind == 2 and one.attrib:
        one.set(list(one.attrib)[int(rng.integers(len(one.attrib)))], _nasty(rng))
    elif kind == 3 and one is not root and other not in one.iter():
        other.append(one)
    elif kind == 4 and rng.random() < 0.5:
        one.append(ElementTree.Element(TAGS[int(rng.integers(len(TAGS)))], {"name": "x"}))
    elif kind == 4:
        one.append(ElementTree.fromstring(LARGE[int(rng.integers(len(LARGE)))]))
    elif kind == 5 and len(one):
        one.remove(one[int(rng.integers(len(one)))])
    else:
        numbers = [float(x) for x in one.get("pos", "0 0 0").split()]
        one.set("pos", " ".join(str(x * float(rng.choice([-1, 2, 1e3, 1e-9]))) for x in numbers))
    return ElementTree.tostring(root)


STRUCTURES = {
    ".json": by_json,
    ".jsonl": by_lines,
    ".toml": by_toml,
    ".csv": by_csv,
    ".xml": by_xml,
    ".txt": by_tokens,
    ".obj": by_tokens,
    ".stl": by_stl,
    ".3mf": by_zip,
}


def _nasty(rng: Chance) -> str:
    return NASTY[int(rng.integers(len(NASTY)))]


def _changed(document: Any, rng: Chance) -> Any:
    """One value somewhere in a document of dictionaries and lists changed."""
    places = list(_places(document))
    if not places:
        return VALUES[int(rng.integers(len(VALUES)))]
    holder, key = places[int(rng.integers(len(places)))]
    kind = int(rng.integers(7))
    if kind <= 2:
        holder[key] = VALUES[int(rng.integers(len(VALUES)))]
    elif kind == 3:
        del holder[key]
    elif kind == 4 and isinstance(holder, dict):
        holder[_nasty(rng)] = holder.pop(key)
    elif kind == 5:
        depth = int(rng.choice([1, 3, 40, 400]))
        for _ in range(depth):
            holder[key] = [holder[key]] if rng.random() < 0.9 else {"x": holder[key]}
    elif isinstance(holder[key], int | float):
        factor = float(rng.choice([-1.0, 0.999, 10.0, 1e6, 1e-9]))
        holder[key] = holder[key] * factor if abs(holder[key]) < 1e300 else -holder[key]
    else:
        holder[key] = [holder[key]] * int(rng.choice([0, 2, 7, 1000]))
    return document


def _places(value: Any) -> Any:
    if isinstance(value, dict):
        for key in value:
            yield value, key
            yield from _places(value[key])
    elif isinstance(value, list):
        for key, entry in enumerate(value):
            yield value, key
            yield from _places(entry)


def _key(key: str) -> str:
    return key if re.fullmatch(r"[\w-]+", key, re.ASCII) else json.dumps(key)


def _toml(value: Any) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(key)} = {_toml(entry)}" for key, entry in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, float):
        return str(value)
    return "''" if value is None else json.dumps(value, ensure_ascii=True)
