"""Words and columns that several texts are made of.

Things that belong together, put together.

Text from anywhere, for a terminal: it is shown and not obeyed.
"""

import re
from collections.abc import Hashable, Iterable, Sequence
from typing import TypeVar

import numpy as np

from apo_bench.geometry import Array


def with_article(part: str) -> str:
    """`the stick`, but `castle2` and `A`."""
    return part if part[-1].isdigit() or part[0].isupper() else f"the {part}"


def listed_words(words: Iterable[str]) -> str:
    """`x`, `x and y`, `x, y and yaw`; empty if there are none."""
    *most, last = [*words] or [""]
    return f"{', '.join(most)} and {last}" if most else last


def columns(table: Sequence[Sequence[str]]) -> list[str]:
    """Rows of equal length as lines, their entries below each other."""
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return ["  ".join(word.ljust(w) for word, w in zip(row, widths, strict=True)).rstrip() for row in table]


def direction(v: Array) -> str:
    """`-z`, or three numbers."""
    for i, axis in enumerate("xyz"):
        if abs(v[i]) > 1.0 - 1e-9:
            return f"{'+' if v[i] > 0 else '-'}{axis}"
    return f"({', '.join(f'{x + 0.0:.3g}' for x in np.round(v, 3))})"


K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


def grouped(pairs: Iterable[tuple[K, V]]) -> dict[K, list[V]]:
    """Key -> all that came with it; keys and what came with them in the order in which they came."""
    groups: dict[K, list[V]] = {}
    for key, value in pairs:
        groups.setdefault(key, []).append(value)
    return groups


_OBEYED = "\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069"
CONTROL = re.compile(f"[{_OBEYED}]")
"""What a terminal obeys instead of showing it, and what turns the direction of text."""
UNSHOWN = re.compile(f"[{_OBEYED}\ud800-\udfff]")
"""Control characters, and the half letters that stand in names of files which are not UTF-8."""

_LONGEST = 1500


def clean(text: str) -> str:
    """One line in which control characters stand as `\\x1b`."""
    return UNSHOWN.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


_MARKDOWN = re.compile(r"[&<>\\`*\[\]{}|$~]|(?<![^\W_])_|_(?![^\W_])")
"""What has a meaning in Markdown or HTML inside a line: underscores do at the ends of a word."""


def markdown(text: str) -> str:
    """One line that Markdown shows as it is, in a cell of a table or behind other text.

    Every character with a meaning becomes a character reference, which begins neither markup nor HTML in any renderer.
    """
    return _MARKDOWN.sub(lambda match: f"&#{ord(match[0])};", " ".join(clean(text).split()))


def brief(text: str) -> str:
    """Without the middle of what is too long to be read."""
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 2 :]}"
