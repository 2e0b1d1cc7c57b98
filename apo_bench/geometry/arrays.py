"""Arrays that stay as they were made."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class NotReal(ValueError):
    """Complex numbers, whose imaginary parts numpy would drop."""


def real(value: ArrayLike) -> Array:
    """A float64 copy of `value`.

    Raises:
        NotReal: It holds complex numbers.
        TypeError, ValueError: It holds no numbers.
    """
    given = np.asarray(value)
    if given.dtype.kind == "c":
        raise NotReal("real numbers are needed, complex ones were given")
    return np.array(given, dtype=np.float64)


def frozen(value: ArrayLike, *shape: int | None) -> Array:
    """A read-only float64 copy of `value`.

    Args:
        shape: The shape it must have; `None` stands for any length.

    Raises:
        ValueError: The shape differs, or a number is complex or not finite.
    """
    array = real(value)
    if shape and (array.ndim != len(shape) or any(map(_differ, shape, array.shape))):
        wanted = ", ".join("*" if s is None else str(s) for s in shape)
        raise ValueError(f"an array of shape ({wanted}) is needed, {array.shape} was given")
    if np.count_nonzero(np.isfinite(array)) < array.size:  # twice as quick as `all`
        raise ValueError("every number must be finite, a NaN or an infinity was given")
    array.setflags(write=False)
    return array


def _differ(wanted: int | None, given: int) -> bool:
    return wanted is not None and wanted != given
