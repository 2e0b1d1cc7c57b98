"""Give functions of this process names that settings can have, for the duration of a run."""

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

from apo_bench.errors import require
from apo_bench.names import SESSION, importable_name


@contextmanager
def name_functions(functions: Mapping[str, Callable[..., Any]]) -> Iterator[Mapping[str, str]]:
    """Give functions names that settings can have; yields label -> name.

    The name of a function that can be imported is `module:name`. Others, such as lambdas and functions of a notebook,
    are `session:label` until the context ends, in this process only.

    Raises:
        InputError: A label is no Python name.
    """
    names = {label: importable_name(function) or f"{SESSION}:{label}" for label, function in functions.items()}
    module = ModuleType(SESSION)  # a module that exists only as long as the context
    module.__spec__ = ModuleSpec(SESSION, None)
    for label, function in functions.items():
        require(label.isidentifier(), f"the method label {label!r} was given; use a Python name, such as my_method.")
        setattr(module, label, function)
    require(SESSION not in sys.modules, f"a module '{SESSION}' is loaded; run one evaluation at a time.")
    sys.modules[SESSION] = module
    try:
        yield names
    finally:
        del sys.modules[SESSION]
