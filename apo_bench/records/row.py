"""A row: all that is kept of one trial."""

from __future__ import annotations

from typing import Any

Row = dict[str, Any]
"""One line of `trials.jsonl`: lengths in mm, angles in degrees, quaternions wxyz, operations numbered from 1. What each
field may be stands in `fields.ROW_FIELDS`."""
LONGEST_SENTENCE = 1000
LARGEST = 1e15
"""Of a number that physics or a solver gave; beyond, sums and pictures of it say nothing."""


def finite(x: float | None) -> float | None:
    """A number that a row can hold, else null."""
    return float(x) if x is not None and abs(x) <= LARGEST else None
