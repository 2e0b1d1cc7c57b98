"""What follows from an object that never changes is worked out once."""

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

Given = ParamSpec("Given")
Found = TypeVar("Found")

_MOST = 16
"""Answers that are kept of one object; further ones are worked out each time."""


def remembered(function: Callable[Given, Found]) -> Callable[Given, Found]:
    """Keep what a function of an object, and of plain values, returned, for as long as the object lives.

    For objects that are compared by identity and never change. What is returned is shared, so nobody may change it.
    """
    known: WeakKeyDictionary[Any, dict[tuple[Any, ...], Found]] = WeakKeyDictionary()

    @wraps(function)
    def found(*given: Given.args, **named: Given.kwargs) -> Found:
        answers = known.setdefault(given[0], {})
        asked = (given[1:], *sorted(named.items()))
        if asked in answers:
            return answers[asked]
        made = function(*given, **named)
        if len(answers) < _MOST:
            answers[asked] = made
        return made

    return found
