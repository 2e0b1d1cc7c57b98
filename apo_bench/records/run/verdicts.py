"""Which verdict a folder of rows is read by, chosen once: `success`, or `as_demonstrated` of rows that are older.

Rows up to `apo-bench/row/5` had one verdict and called it success; it is the one that is called `as_demonstrated` now.
What `success` is today nobody asked then, so it is not known of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from apo_bench.errors import InputError
from apo_bench.records.row import Row
from apo_bench.records.settings import ROW

SUCCESS, AS_DEMONSTRATED = "success", "as_demonstrated"
_WORDS = (
    "These rows were written before the verdict success was given (they are older than {row}): wherever success is "
    "said here, it is as_demonstrated, which also asks that every contact was made when and where it was shown. Run "
    "the sweep again with this version for success."
)


def _as_it_says(row: Row) -> Row:
    return row


def _one_verdict(row: Row) -> Row:
    """Null remains null: of a demonstration that was not right itself neither verdict is given."""
    return row | {"success": None, "as_demonstrated": row["success"]}


MEANING: Mapping[str, Callable[[Row], Row]] = MappingProxyType(
    {
        **{f"apo-bench/row/{version}": _one_verdict for version in (2, 3, 4, 5)},
        "apo-bench/row/6": _as_it_says,
        ROW: _as_it_says,
    }
)
"""Schema -> what a row of it says in the words of today. Rows before the last say less: nothing about the test of a
correction and its posterior (2), recognised contacts (3), the eye and the fidelity (4), two verdicts (5), looks (6)."""


def has_both_verdicts(schema: str) -> bool:
    """Whether rows of a schema say both `success` and `as_demonstrated`."""
    return MEANING[schema] is _as_it_says


def verdict_of(rows: Sequence[Mapping[str, Any]], folder: str | Path) -> str:
    """The verdict that all rows of a folder have.

    Raises:
        InputError: Some rows are older than others, such that their verdicts are not the same.
    """
    schemas = sorted({row["schema"] for row in rows})
    older, newer = ([s for s in schemas if has_both_verdicts(s) is both] for both in (False, True))
    if newer and older:
        raise InputError(
            f"'{folder}' holds rows of schema '{older[0]}' and of '{newer[0]}', whose verdicts are not the same; "
            "keep them in folders of their own."
        )
    return AS_DEMONSTRATED if older else SUCCESS


def by_verdict(rows: Sequence[Row], verdict: str) -> Sequence[Row]:
    """The rows with the verdict as their `success`, so that rates, tables and pictures are of it."""
    return rows if verdict == SUCCESS else [row | {"success": row["as_demonstrated"]} for row in rows]


def verdict_warning(verdict: str) -> str:
    """What is to be said of it at the top; empty where success is success."""
    return "" if verdict == SUCCESS else _WORDS.format(row=ROW)
