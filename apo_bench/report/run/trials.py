"""How trials ended, in a few words, and which failures a report shows as pictures; others can draw them."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from apo_bench.io.grouping import grouped
from apo_bench.records import Row, Salt
from apo_bench.records.run.own_code import left_out, own_code
from apo_bench.records.run.replay_command import Files
from apo_bench.statistics import NOT_EXECUTED, rank


class FailurePicture(NamedTuple):
    """Of one trial."""

    row: Row
    jpeg: bytes
    words: str
    """How it was made."""


Draw = Callable[..., tuple[list[FailurePicture], list[str]]]
"""Runs failed trials again and draws them, as `failure_pictures` of `apo_bench.show` does; the sentences say what could
not be drawn."""


def verdict(row: Row) -> str:
    """How a trial ended, in a word or two."""
    if row["success"] is None:
        return "excluded"
    if row["success"]:
        return "right" if row["as_demonstrated"] else "right, not as demonstrated"
    return "loosely right" if row["loose_success"] else "failed"


def why(row: Row) -> str:
    """`attach: force_stop, operation 3`; nothing where nothing failed."""
    if row["failure_stage"] is None:
        return ""
    where = "" if row.get("failure_operation") is None else f", operation {row['failure_operation']}"
    return f"{row['failure_stage']}: {row['failure_code']}{where}"


def draw_failures(
    rows: Sequence[Row], folder: Path, files: Files, most: int, draw: Draw | None, salt: Salt | None, trust_code: bool
) -> tuple[list[FailurePicture], list[str]]:
    """So many pictures at most, and sentences on those that are missing.

    Args:
        trust_code: Run also trials that name code that does not come with the package.
    """
    if not most or draw is None:
        return [], []
    pictures, missing = draw(sample(rows, most, trust_code=trust_code), folder, files, salt, trust_code=trust_code)
    without = "" if trust_code else left_out(rows)
    return pictures, [*missing, *([without] if without else [])]


def sample(rows: Iterable[Row], most: int, *, trust_code: bool = False) -> list[Row]:
    """Failures to be drawn: one for each way of failing, the most frequent first, methods and scenarios varied.

    The same rows, in any order, give the same sample. Trials that were not carried out have nothing to be seen.

    Args:
        trust_code: Also trials that name code of somebody's own.
    """
    failed = (row for row in rows if row["success"] is False and row["level"] is not None and row.get("sim_seconds"))
    ways = grouped(
        ((str(row["failure_stage"]), str(row["failure_code"])), row)
        for row in failed
        if row["failure_stage"] not in NOT_EXECUTED and (trust_code or not own_code(row))
    )
    chosen: list[Row] = []
    for _, alike in sorted(ways.items(), key=lambda way: (-len(way[1]), way[0]))[:most]:
        chosen.append(_least_shown(sorted(alike, key=_order), chosen))
    return chosen


def _order(row: Row) -> tuple[Any, ...]:
    where = (row["scenario"], row["clearance_mm"], row["noise"], row["relations"], row["careless"], row["level"])
    return (row["seed"], rank(row["method"]) == 1, rank(row["method"]), row["method"], where)


def _least_shown(alike: Sequence[Row], chosen: Sequence[Row]) -> Row:
    """The first one of a method and scenario that was chosen least."""
    shown = Counter(x for row in chosen for x in (("method", row["method"]), ("scenario", row["scenario"])))
    return min(alike, key=lambda row: shown["method", row["method"]] + shown["scenario", row["scenario"]])
