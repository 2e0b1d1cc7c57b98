"""Words, lists and columns for texts."""

from collections.abc import Iterable, Sequence

import numpy as np

from apo_bench.geometry import Array


def add_the(part: str) -> str:
    """`the stick`, but `castle2` and `A`."""
    return part if part[-1].isdigit() or part[0].isupper() else f"the {part}"


def format_count(n: int, noun: str) -> str:
    """`1 trial`, `2,000 trials`."""
    return f"{n:,} {noun}{'' if n == 1 else 's'}"


def join_words(words: Iterable[str]) -> str:
    """`x`, `x and y`, `x, y and yaw`; empty if there are none."""
    *most, last = [*words] or [""]
    return f"{', '.join(most)} and {last}" if most else last


def align_columns(table: Sequence[Sequence[str]]) -> list[str]:
    """Rows of equal length as lines, their entries below each other."""
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return ["  ".join(word.ljust(w) for word, w in zip(row, widths, strict=True)).rstrip() for row in table]


def format_direction(v: Array) -> str:
    """`-z`, or three numbers."""
    for i, axis in enumerate("xyz"):
        if abs(v[i]) > 1.0 - 1e-9:
            return f"{'+' if v[i] > 0 else '-'}{axis}"
    return f"({', '.join(f'{x + 0.0:.3g}' for x in np.round(v, 3))})"
