"""The one exception that a user sees, `InputError`, and the sentences of its messages: cause, then remedy."""

from collections.abc import Collection, Iterable
from difflib import get_close_matches
from numbers import Real
from pathlib import PurePath
from typing import Any

_MOST = 24
"""Most names that a message lists."""
_LONGEST = 200
"""Most letters of a value that a message repeats."""


RAISED = (Exception, SystemExit)
"""Exceptions of user code that are caught; `sys.exit` in it must not end this program as if it had succeeded."""


class InputError(ValueError):
    """An argument or a file is wrong; the message is one sentence with cause and remedy (command line: exit code 2).

    Examples:
        >>> import apo_bench
        >>> apo_bench.load_scenario("stick_in_towr")
        Traceback (most recent call last):
        apo_bench.errors.InputError: unknown scenario 'stick_in_towr'; ...
    """


class ArgumentError(InputError):
    """An argument of a public function, or a field of a public record, that is not what it takes."""


def unknown(kind: str, given: str, allowed: Iterable[str]) -> str:
    """Return `unknown corrector 'papr'; did you mean 'paper'? Known: none, oracle, paper.`."""
    names = sorted(allowed)
    # the given text may be the beginning of a name
    longer = [name for name in names if given and name.startswith(given)]
    near = longer or get_close_matches(given, names, n=1, cutoff=0.5)
    hint = f"; did you mean '{near[0]}'?" if near else "."
    shown = names if len(names) <= _MOST else get_close_matches(given, names, n=_MOST, cutoff=0.3)
    more = "" if len(shown) == len(names) else f" (nearest of {len(names)})"
    return f"unknown {kind} '{one_line(given, _LONGEST)}'{hint} Known: {', '.join(shown) or 'none'}{more}."


def one_line(text: str, longest: int) -> str:
    """Return the beginning of a text on one line, with line ends and control characters escaped."""
    text = text[:longest]
    return text if text.isprintable() else ascii(text)[1:-1]


def failed(what: str, error: BaseException) -> InputError:
    """Return an `InputError` about an exception of user code: `... failed: it raised RuntimeError('oops'); ...`."""
    try:
        # messages of these types are sentences
        text = " ".join(str(error).split()) if type(error) in (ValueError, ArgumentError) else ""
        reason = text.rstrip(".") or f"it raised {' '.join(repr(error).split())}"
    except Exception:  # str or repr of the exception raised as well
        reason = f"it raised {type(error).__name__}"
    return InputError(f"{what} failed: {reason}; correct it, or use another.")


def missing_package(what: str, package: str, instead: str = "") -> InputError:
    """Return an `InputError` about a missing package: `the format minari needs the package h5py; ...`."""
    return InputError(f"{what} needs the package {package}; install it with: pip install {package}{instead}")


def kind(value: Any) -> str:
    """Return the kind of a value for a sentence: `a str`, `an int`, `None`, `a class`."""
    if value is None or isinstance(value, type):
        return "None" if value is None else "a class"
    name = type(value).__name__.removeprefix("nd")  # an array of NumPy
    return add_article(name)


def shown(value: Any) -> str:
    """Return a value for a sentence: a text, path or number itself; of other values the kind."""
    if isinstance(value, str | PurePath):
        return repr(value)[:_LONGEST]
    return str(value) if isinstance(value, Real) else kind(value)


def add_article(name: str) -> str:
    """Return a name with its indefinite article: `a scenario file`, `an entry`, `an int`."""
    return f"{'an' if name[0].lower() in 'aeiou' else 'a'} {name}"


def require_text(called: str, value: Any) -> None:
    """Raise an `InputError` unless a value is text.

    Args:
        called: Name of the value, for the message.
    """
    require(isinstance(value, str), f"{kind(value)} was given as {called}; a name is needed, a str.")


def require(holds: object, sentence: str) -> None:
    """Raise an `InputError` with this sentence unless a condition holds."""
    if not holds:
        raise InputError(sentence)


def require_known(kind: str, given: str, allowed: Collection[str], place: object = "", rest: str = "") -> None:
    """Raise the `InputError` of `unknown` unless a name is allowed.

    Args:
        place: File and key that the message begins with, if any.
        rest: Sentences that the message ends with.
    """
    if given not in allowed:
        raise InputError(
            f"{place}: {unknown(kind, given, allowed)}{rest}" if place else unknown(kind, given, allowed) + rest
        )
