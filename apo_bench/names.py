"""Everything a user may bring comes by short name, as `module:name`, or as the object itself."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Mapping
from typing import Any

from apo_bench.errors import InputError, unknown


def resolve(given: Any, known: Mapping[str, str], kind: str) -> Any:
    """The object a name stands for; anything that is not a string is returned as it is.

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
        if given not in known:
            raise InputError(unknown(kind, given, known) + " Or give your own as 'package.module:name'.")
        given = known[given]
    module_name, _, attribute = given.partition(":")
    if not module_name or not attribute or module_name.startswith("."):
        raise InputError(
            f"the {kind} '{given}' is not of the form 'package.module:name'; name a module and what is in it."
        )
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        raise InputError(
            f"the {kind} '{given}' cannot be imported ({error}); start in the folder of its module, "
            "or put that on PYTHONPATH."
        ) from error
    except Exception as error:
        raise InputError(f"the {kind} '{given}' cannot be imported: its module raised {error!r}.") from error
    try:
        value: Any = module
        for name in attribute.split("."):
            value = getattr(value, name)
    except AttributeError as error:
        raise InputError(unknown(f"{kind} in module {module_name}", attribute, _public(module))) from error
    return value


def _public(module: Any) -> list[str]:
    """What a module offers: neither the modules that it imports nor functions and classes of other packages."""
    return [name for name, value in vars(module).items() if not name.startswith("_") and _own(value, module.__name__)]


def _own(value: Any, module: str) -> bool:
    """Not what `import` or `from __future__ import` put there, nor a function or class of another package."""
    if inspect.ismodule(value) or isinstance(value, type(annotations)):
        return False
    made = inspect.isroutine(value) or inspect.isclass(value)
    where = getattr(value, "__module__", None) if made else None
    return not isinstance(where, str) or where.partition(".")[0] == module.partition(".")[0]
