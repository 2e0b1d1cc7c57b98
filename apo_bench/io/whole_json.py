"""Refuse JSON objects in which a key stands twice, whose first value would be lost."""

from collections import Counter
from collections.abc import Callable
from typing import Any

from apo_bench.errors import InputError
from apo_bench.io.safe_text import clean

_LONGEST_KEY = 60


def unique_members(where: str) -> Callable[[list[tuple[str, Any]]], dict[str, Any]]:
    """What makes an object of its members for `json.loads`; a key that stands twice is an `InputError`."""

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        members = dict(pairs)
        if len(members) < len(pairs):
            twice = clean(Counter(key for key, _ in pairs).most_common(1)[0][0])[:_LONGEST_KEY]
            raise InputError(f"{where}: the key '{twice}' stands twice in one object; keep one of the two.")
        return members

    return unique
