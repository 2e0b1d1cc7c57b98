"""Resolve a short name, `module:name`, or an object itself, to the object."""

import importlib
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

from apo_bench.errors import RAISED, InputError, require, require_known, unknown

SESSION = "session"
"""The module part of the name of a function that cannot be imported: `session:mine`."""
_FOLDERS: list[str] = []
"""Folders that are searched for modules named by the user, after the import path; only the last one counts."""


@contextmanager
def own_modules_in(folder: str) -> Iterator[None]:
    """Search modules named as `module:name` also in a folder, for the duration of the context.

    While such a module is imported, it can import modules of its folder. No other module of the folder is ever
    imported.
    """
    _FOLDERS.append(folder)
    try:
        yield
    finally:
        _FOLDERS.pop()


def add_own_modules(folder: str) -> None:
    """Search modules also in a folder, as `own_modules_in` does, from now on; an empty text adds none."""
    _FOLDERS.extend([folder] * bool(folder))


def folder_of_own_modules() -> str:
    """Return the folder of `own_modules_in`, to pass it to another process; empty without one."""
    return _FOLDERS[-1] if _FOLDERS else ""


def find_own_module(name: str) -> ModuleSpec | None:
    """Return the specification of a module in the folder of `own_modules_in`; None if there is none."""
    return PathFinder.find_spec(name, _FOLDERS[-1:])


def resolve(given: Any, known: Mapping[str, str], kind: str) -> Any:
    """Return the object a name stands for; anything that is not a string is returned as it is.

    Args:
        given: A short name out of `known`, `"package.module:name"`, or the object itself.
        known: Short name -> `"package.module:name"`.
        kind: What it is, for the message: `corrector`, `noise model`.

    Raises:
        InputError: No such name, module or attribute.
    """
    if not isinstance(given, str):
        return given
    if ":" not in given:
        require_known(kind, given, known, rest=" Or give your own as 'package.module:name'.")
        given = known[given]
    module_name, _, attribute = given.partition(":")
    require(
        module_name and attribute and not module_name.startswith("."),
        f"the {kind} '{given}' is not of the form 'package.module:name'; name a module and what is in it.",
    )
    try:
        module = _import_named(module_name)
    except ImportError as error:
        raise InputError(
            f"the {kind} '{given}' cannot be imported ({error}); start in the folder of its module, "
            "or put that on PYTHONPATH."
        ) from error
    except RAISED as error:
        raise InputError(f"the {kind} '{given}' cannot be imported: its module raised {error!r}.") from error
    try:
        value: Any = module
        for name in attribute.split("."):
            value = getattr(value, name)
    except AttributeError as error:
        raise InputError(unknown(f"{kind} in module {module_name}", attribute, _public(module))) from error
    return value


def _import_named(name: str) -> ModuleType:
    """Import a module that the user named, with its folder at the end of the import path during the import."""
    before = sys.path[:]
    if find_own_module(name.partition(".")[0]) is not None:
        sys.path += _FOLDERS[-1:]
    try:
        return importlib.import_module(name)
    finally:
        sys.path[:] = before


def _public(module: Any) -> list[str]:
    """List the functions and classes that a module defines."""
    own = {name: value for name, value in vars(module).items() if not name.startswith("_")}
    return [name for name, value in own.items() if getattr(value, "__module__", None) == module.__name__]


def importable_name(function: Any) -> str | None:
    """Return `module:name` of a function or class that another process can import; None of any other object."""
    module, name = getattr(function, "__module__", None), getattr(function, "__qualname__", "")
    if module in (None, "__main__") or "<" in name or getattr(sys.modules.get(module), name, None) is not function:
        return None
    return f"{module}:{name}"


def function_name(function: Any) -> str:
    """Return the name of a function for records: `module:name`, or `session:name` if it cannot be imported."""
    label = getattr(function, "__name__", type(function).__name__)
    return importable_name(function) or f"{SESSION}:{label.strip('<>')}"
