"""Format words, lists and aligned columns."""

from collections.abc import Collection, Iterable, Sequence

import numpy as np

from apo_bench.geometry import Array


def add_the(part: str) -> str:
    """Return a part with its article: `the stick`, but `castle2` and `A` without."""
    return part if part[-1].isdigit() or part[0].isupper() else f"the {part}"


def format_count(n: int, noun: str) -> str:
    """Format a count: `1 trial`, `2,000 trials`."""
    return f"{n:,} {noun}{'' if n == 1 else 's'}"


def join_words(words: Iterable[str]) -> str:
    """Join words: `x`, `x and y`, `x, y and yaw`; empty if there are none."""
    *most, last = [*words] or [""]
    return f"{', '.join(most)} and {last}" if most else last


def align_columns(table: Sequence[Sequence[str]], numbers: Collection[int] = ()) -> list[str]:
    """Return the rows of a table as lines with aligned columns.

    Args:
        numbers: Indices of the columns that are aligned to the right.
    """
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    pads = [str.rjust if i in numbers else str.ljust for i in range(len(widths))]
    return ["  ".join(pad(cell, w) for pad, cell, w in zip(pads, row, widths, strict=True)).rstrip() for row in table]


def format_direction(v: Array) -> str:
    """Format a unit vector, (3,): `-z` along an axis, else three numbers."""
    for i, axis in enumerate("xyz"):
        if abs(v[i]) > 1.0 - 1e-9:
            return f"{'+' if v[i] > 0 else '-'}{axis}"
    return f"({', '.join(f'{x + 0.0:.3g}' for x in np.round(v, 3))})"
