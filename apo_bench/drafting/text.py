"""What a person reads of a scenario that was drafted, and of one that was checked."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from apo_bench.drafting.checking import Finding
    from apo_bench.drafting.draft import Draft


def draft_lines(draft: Draft) -> Iterator[str]:
    """The choices that were made, and what is to be known."""
    yield f"fixed: {', '.join(draft.fixed)} ({draft.why_fixed})"
    for k, placing in enumerate(draft.order, start=1):
        carried = f" with {', '.join(placing.moves[1:])}" if placing.moves[1:] else ""
        yield f"{k}. {placing.moves[0]}{carried} {placing.why}: {len(placing.contacts)} contacts"
    for note in draft.notes:
        yield f"note: {note}"


def finding_line(found: Finding) -> str:
    """`wrong  reach    line 41: ...`."""
    line = f"line {found.line}: " if found.line else ""
    return f"{'ok' if found.ok else 'wrong':6} {found.what:8} {line}{found.sentence}"
