"""Check the arguments of public functions and constructors against their annotations.

An argument of another type raises an error with one sentence. Numbers of NumPy count as numbers; lists are accepted as
tuples and arrays. Where several names are allowed, a text is one name, not a sequence of letters. Functions check
ranges and shapes themselves.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from functools import wraps
from inspect import CO_VARKEYWORDS
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from apo_bench.errors import ArgumentError, add_article, shown, unknown

Public = TypeVar("Public", bound=Callable[..., Any])


class _Unfit(Exception):
    """Raised for a value, or an entry of one, of the wrong type; its argument is that value or entry."""


class _Type(NamedTuple):
    """The check that an annotation describes."""

    words: str
    """The type in words: `a number`."""
    take: Callable[[Any], Any]
    """Returns a value converted for the function, or raises `_Unfit`."""


def check_arguments(public: Public) -> Public:
    """Make a function, or the constructor of a class, check its arguments against its annotations.

    Annotations are read at the first call. Python itself rejects a call without a required argument.

    Raises:
        ArgumentError: On a call with an argument of another type, or with an unknown keyword.
    """
    function: Any = vars(public)["__init__"] if isinstance(public, type) else public
    called = public.__qualname__.removesuffix(".__call__")
    code = function.__code__
    positional = code.co_varnames[: code.co_argcount]
    keywords = frozenset(code.co_varnames[code.co_posonlyargcount : code.co_argcount + code.co_kwonlyargcount])
    takes_any = bool(code.co_flags & CO_VARKEYWORDS)
    types: dict[str, _Type] = {}

    def take(name: str, value: Any) -> Any:
        if name not in types:
            return value
        try:
            return types[name].take(value)
        except _Unfit as unfit:
            within = "" if unfit.args[0] is value else f" with {shown(unfit.args[0])} in it"
            wanted = f"{name} of {called} must be {types[name].words}"
            raise ArgumentError(f"{wanted}, got {shown(value)}{within}.") from None

    @wraps(function)
    def checked(*given: Any, **named: Any) -> Any:
        if not types:
            types.update({name: _read(hint) for name, hint in get_type_hints(function, include_extras=True).items()})
        if not takes_any and not named.keys() <= keywords:
            name = next(name for name in named if name not in keywords)
            raise ArgumentError(unknown(f"argument of {called}", name, keywords - {"self"}))
        values = (*map(take, positional, given), *given[len(positional) :])  # surplus arguments are left to Python
        return function(*values, **{name: take(name, value) for name, value in named.items()})

    if isinstance(public, type):
        public.__init__ = checked  # type: ignore[misc]
        return public
    return checked  # type: ignore[return-value]


def _read(hint: Any) -> _Type:
    """Return the check of an annotation."""
    origin = get_origin(hint) or hint
    within = get_args(hint)
    if hint in _PLAIN:
        return _PLAIN[hint]
    if origin is Annotated:
        return _read(within[0])
    if origin in (Union, UnionType):
        return _one_of([*map(_read, within)])
    if origin is Literal:
        return _that(f"one of {', '.join(map(repr, within))}", lambda x: isinstance(x, str) and x in within)
    if origin is Callable:
        return _that("a function", callable)
    if origin is np.ndarray:
        return _array(is_truth=np.dtype[np.bool_] in within)
    if not isinstance(origin, type) or _is_unchecked_protocol(origin):
        return _ANYTHING
    if issubclass(origin, tuple) and hasattr(origin, "_fields"):
        return _named_tuple(origin)
    if issubclass(origin, Mapping):
        return _that("a mapping", lambda x: isinstance(x, Mapping))
    if issubclass(origin, Collection) and within:
        return _several(origin, within)
    return _that(add_article(origin.__name__), lambda x: isinstance(x, origin))


def _is_unchecked_protocol(origin: type) -> bool:
    """Return whether a type is a protocol with which isinstance does not work."""
    return getattr(origin, "_is_protocol", False) and not getattr(origin, "_is_runtime_protocol", False)


def _require(fits: object, value: Any) -> None:
    """Raise `_Unfit` with this value unless a condition holds."""
    if not fits:
        raise _Unfit(value)


def _that(words: str, fits: Callable[[Any], object]) -> _Type:
    """Return the check of a condition on a value, which is not converted."""

    def take(value: Any) -> Any:
        _require(fits(value), value)
        return value

    return _Type(words, take)


def _is_number(value: Any) -> bool:
    return type(value) in _USUAL_NUMBERS or (isinstance(value, Real) and not isinstance(value, bool))


def _whole(value: Any) -> Any:
    """Return a whole number as it is, or a float with a whole value, such as 2.0, as an int."""
    if type(value) is int:
        return value
    _require(_is_number(value) and (isinstance(value, Integral) or float(value).is_integer()), value)
    return value if isinstance(value, Integral) else int(value)


# checked first, since an isinstance check with Real takes ten times as long
_USUAL_NUMBERS = (float, int)
_ANYTHING = _that("anything", lambda _: True)
_NONE = _that("None", lambda x: x is None)
_PLAIN: Mapping[Any, _Type] = {
    Any: _ANYTHING,
    object: _ANYTHING,
    None: _NONE,
    NoneType: _NONE,
    str: _that("a text", lambda x: isinstance(x, str)),
    bool: _that("True or False", lambda x: isinstance(x, bool | np.bool_)),
    int: _Type("a whole number", _whole),
    float: _that("a number", _is_number),
}


def _one_of(types: list[_Type]) -> _Type:
    """Return a check that accepts a value of any of several types, tried in order."""

    def take(value: Any) -> Any:
        last = _Unfit(value)
        for each in types:
            try:
                return each.take(value)
            except _Unfit as unfit:
                last = unfit
        raise last

    *words, end = dict.fromkeys(each.words for each in types)
    return _Type(f"{', '.join(words)} or {end}" if words else end, take)


def _array(is_truth: bool) -> _Type:
    """Return the check of an array of real numbers; or of booleans, given also as 0 and 1."""
    usual = np.dtype(np.bool_ if is_truth else np.float64)

    def take(value: Any) -> Any:
        # the usual case, without a conversion
        if type(value) is np.ndarray and value.dtype == usual and value.ndim:
            return value
        try:
            array = np.asarray(value)
        except ValueError:
            raise _Unfit(value) from None
        _require(array.ndim and array.dtype.kind in "biuf" and (not is_truth or np.isin(array, (0, 1)).all()), value)
        return array

    return _Type("an array of True and False" if is_truth else "an array of real numbers", take)


def _several(origin: type, within: tuple[Any, ...]) -> _Type:
    """Return the check of a collection, converted to a tuple or set where needed; a text is a single entry."""
    entries = [_read(each) for each in within if each is not Ellipsis]
    count = len(entries) if origin is tuple and Ellipsis not in within else None  # fixed length of a tuple
    make: Any = origin if origin in (tuple, list, set, frozenset) else tuple

    def take(value: Any) -> Any:
        several = (value,) if isinstance(value, str) else value
        _require(isinstance(several, Iterable), value)
        given = tuple(several)
        _require(count in (None, len(given)), value)
        return _remade(several, given, entries if count else entries * len(given), origin, make)

    if count is None:
        return _Type(f"a list (each entry {entries[0].words})", take)
    return _Type(f"a list of {' and '.join(one.words for one in entries)}", take)


def _named_tuple(origin: Any) -> _Type:
    """Return the check of a named tuple, which is made from a plain tuple or a list if needed."""
    types = [_read(hint) for hint in get_type_hints(origin, include_extras=True).values()]
    least = len(types) - len(origin._field_defaults)  # fields without a default

    def take(value: Any) -> Any:
        _require(isinstance(value, tuple | list) and least <= len(value) <= len(types), value)
        return _remade(value, tuple(value), types[: len(value)], origin, lambda entries: origin(*entries))

    return _Type(add_article(origin.__name__), take)


def _remade(value: Any, given: tuple[Any, ...], types: list[_Type], origin: type, make: Callable[[Any], Any]) -> Any:
    """Return a value itself if no entry needs a conversion, else a new one with the converted entries."""
    taken = [one.take(each) for one, each in zip(types, given, strict=True)]
    is_same = isinstance(value, origin) and all(a is b for a, b in zip(taken, given, strict=True))
    return value if is_same else make(taken)
