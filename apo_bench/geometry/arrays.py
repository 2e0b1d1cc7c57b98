"""Immutable records: read-only arrays in frozen dataclasses and their copies, and a cache of results by object."""

import copyreg
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial, wraps
from types import MappingProxyType
from typing import Any, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from apo_bench.errors import ArgumentError, kind

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Record = TypeVar("Record")
Arguments = ParamSpec("Arguments")
Answer = TypeVar("Answer")

_MOST_RESULTS = 16
"""Most results that the cache keeps per object; further ones are computed each time."""


def copy_real(value: ArrayLike) -> Array:
    """A float64 copy of `value`.

    Raises:
        ArgumentError: It holds complex numbers, whose imaginary parts numpy would drop.
        TypeError, ValueError: It holds no numbers.
    """
    array = np.asarray(value)
    if array.dtype.kind == "c":
        raise ArgumentError("real numbers are needed, complex ones were given")
    return np.array(array, dtype=np.float64)


def copy_frozen(value: ArrayLike, *shape: int | None) -> Array:
    """A read-only float64 copy of `value`.

    Args:
        shape: The shape it must have; `None` stands for any length.

    Raises:
        ArgumentError: It holds no numbers, the shape differs, or a number is complex or not finite.
    """
    try:
        array = copy_real(value)
    except ArgumentError:
        raise
    except (TypeError, ValueError):
        raise ArgumentError(f"an array of numbers is needed, {kind(value)} was given") from None
    fits = array.shape == shape or (
        array.ndim == len(shape) and all(s in (None, n) for s, n in zip(shape, array.shape, strict=True))
    )
    if shape and not fits:
        wanted = ", ".join("*" if s is None else str(s) for s in shape)
        raise ArgumentError(f"an array of shape ({wanted}) is needed, {array.shape} was given")
    if 0 in np.isfinite(array).tobytes():  # three times as quick as `all`
        raise ArgumentError("every number must be finite, a NaN or an infinity was given")
    array.setflags(write=False)
    return array


def freeze(record: Any, **shapes: tuple[int | None, ...] | None) -> None:
    """Replace fields of a frozen dataclass by read-only copies; fields that are None stay so.

    Args:
        shapes: Field -> the shape of its array, as in `copy_frozen`, or of each array in it, if it is a mapping; None:
            it is a mapping of other things.

    Raises:
        ArgumentError: An array is not as `copy_frozen` needs it, with the name of the field.
    """
    for name, shape in shapes.items():
        value = getattr(record, name)
        if value is None:
            continue
        try:
            if isinstance(value, Mapping):
                kept = value if shape is None else {key: copy_frozen(each, *shape) for key, each in value.items()}
                object.__setattr__(record, name, MappingProxyType(dict(kept)))
            elif shape is not None:
                object.__setattr__(record, name, copy_frozen(value, *shape))
        except ArgumentError as error:
            raise ArgumentError(f"{name} of {type(record).__name__}: {error}.") from None


def make_copyable(record: type[Record]) -> type[Record]:
    """Decorate a frozen dataclass so that it is copied and pickled through its constructor: copies are read-only too.

    A read-only mapping cannot be pickled by itself, and an array that was pickled can be written to.
    """
    copyreg.pickle(record, _reduce_record)
    return record


def _reduce_record(record: Any) -> tuple[Any, ...]:
    """Reduce a record to its class and plain fields, as `copyreg.pickle` needs it."""
    values = {field.name: getattr(record, field.name) for field in fields(record)}
    plain = {name: dict(value) if isinstance(value, MappingProxyType) else value for name, value in values.items()}
    return partial(record.__class__, **plain), ()


def remember(function: Callable[Arguments, Answer]) -> Callable[Arguments, Answer]:
    """Decorate a function to cache its results by its first argument, an object, for as long as that object lives.

    The object must be compared by identity and never change; other arguments must be hashable. Results are shared, so
    they must not be changed.
    """
    known: WeakKeyDictionary[Any, dict[tuple[Any, ...], Answer]] = WeakKeyDictionary()

    @wraps(function)
    def remembering(*args: Arguments.args, **named: Arguments.kwargs) -> Answer:
        answers = known.setdefault(args[0], {})
        key = (args[1:], *sorted(named.items()))
        if key in answers:
            return answers[key]
        answer = function(*args, **named)
        if len(answers) < _MOST_RESULTS:
            answers[key] = answer
        return answer

    return remembering
