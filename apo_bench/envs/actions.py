"""Read the actions that a caller gives, or say in one sentence what is needed."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from apo_bench.errors import InputError, shown


def read_action(action: Any, size: int) -> NDArray[np.float32]:
    """Return an action with its numbers clipped to -1 and 1, as `gymnasium.wrappers.ClipAction` does.

    Raises:
        InputError: It is no array of so many finite numbers.
    """
    try:
        given = np.asarray(action, dtype=np.float32)
    except (TypeError, ValueError):
        given = np.zeros(0, dtype=np.float32)
    if given.shape != (size,) or not np.isfinite(given).all():
        raise InputError(
            f"{describe_numbers(action)} was given as an action; an array of shape ({size},) with finite numbers is "
            "needed, and numbers beyond -1 and 1 are clipped."
        )
    return np.clip(given, -1.0, 1.0)


def describe_numbers(given: Any) -> str:
    """Return what was given in words: of an array its shape and the range of its numbers."""
    if not isinstance(given, np.ndarray):
        return shown(given)
    numbers = given.size and np.issubdtype(given.dtype, np.number)
    return f"an array of shape {given.shape}" + (f" from {given.min():g} to {given.max():g}" if numbers else "")
