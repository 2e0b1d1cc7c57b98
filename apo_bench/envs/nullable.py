"""Numbers in the infos of an environment that may be missing.

A vector environment gathers the infos of its environments into arrays. If the first has an `int` it makes an array
that holds nothing but ints, and a None of the next one raises; numbers of these types go into an array of objects.
"""

from collections.abc import Mapping
from typing import Any, final


@final
class Whole(int):
    """A whole number beside which None may stand."""


@final
class Real(float):
    """A number beside which None may stand."""


def whole(x: int | None) -> Whole | None:
    return None if x is None else Whole(x)


def predicted_info(said: Mapping[str, Any]) -> dict[str, Any]:
    """What a plan said about itself, as in a row, fit for infos."""
    size_mm = said["size_mm"]
    return {
        **said,
        "operation": whole(said["operation"]),
        "size_mm": None if size_mm is None else Real(size_mm),
    }
