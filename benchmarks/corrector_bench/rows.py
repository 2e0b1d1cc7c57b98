"""One line of the table, and how a list of them is written."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

OPERATORS = {"<=": lambda value, bound: value <= bound, ">=": lambda value, bound: value >= bound}


class TrialRecord(NamedTuple):
    """A target and what was measured."""

    id: str
    """Q1 to Q7, P1 to P5, `coverage`, or `peer` for what is reported of others and not judged."""
    problem: str
    what: str
    value: float | None
    """None if it could not be measured; `note` says why."""
    target: str = ""
    """`<= 1e-9`, `0.4 .. 1.6`, or empty if it is reported only."""
    note: str = ""
    detail: Mapping[str, Any] = {}

    @property
    def met(self) -> bool | None:
        """None where there is no target; what could not be measured does not meet one."""
        if not self.target:
            return None
        if self.value is None or math.isnan(self.value):
            return False
        if ".." in self.target:
            low, high = map(float, self.target.split(".."))
            return low <= self.value <= high
        sign, bound = self.target.split()
        return bool(OPERATORS[sign](self.value, float(bound)))


def written(rows: Iterable[TrialRecord], path: Path, head: Mapping[str, Any]) -> None:
    """The rows as JSON, `head` (versions, command) before them; numbers that are not finite become null or text."""
    save({**head, "rows": records(rows)}, path)


def save(document: Mapping[str, Any], path: Path) -> None:
    """Anything as JSON, as `written` does."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(_plain(document), indent=1) + "\n", encoding="utf-8")


def records(rows: Iterable[TrialRecord]) -> list[dict[str, Any]]:
    """Rows as mappings, with whether the target was met."""
    return [{**row._asdict(), "detail": dict(row.detail), "met": row.met} for row in rows]


def read(path: Path) -> list[TrialRecord]:
    """The rows of a file."""
    return restored(json.loads(path.read_text(encoding="utf-8"))["rows"])


def restored(records: Iterable[Mapping[str, Any]]) -> list[TrialRecord]:
    """Rows out of mappings."""
    return [TrialRecord(**{field: record[field] for field in TrialRecord._fields}) for record in records]


def printed(rows: Iterable[TrialRecord]) -> str:
    """The table for a terminal."""
    lines = [("", "problem", "what", "measured", "target", "")]
    for row in rows:
        value = "-" if row.value is None else f"{row.value:.4g}"
        met = {True: "met", False: "MISSED", None: ""}[row.met]
        lines.append((row.id, row.problem, row.what, value, row.target, f"{met} {row.note}".strip()))
    widths = [max(len(line[k]) for line in lines) for k in range(5)]
    return "\n".join(
        "  ".join([*(cell.ljust(w) for cell, w in zip(line, widths, strict=False)), line[5]]) for line in lines
    )


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else str(value)
    return value
