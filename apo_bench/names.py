"""Everything a user may bring comes by short name, as `module:name`, or as the object itself.

A command also finds such a module in the current folder, which is on no path: what else lies there is not imported.
"""

from __future__ import annotations

import importlib
import inspect
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.machinery import ModuleSpec, PathFinder
from types import FrameType, ModuleType
from typing import Any, final

from apo_bench.errors import InputError, require, require_known, unknown


@final
class OwnModules:
    """Finds modules in one folder, after all other places: those admitted by name, and what they import in turn.

    Where a dependency tries an optional package, as `pandas`, a file of that name in the folder is not its package.
    """

    def __init__(self, folder: str) -> None:
        self.folder = folder
        self._admitted: set[str] = set()
        self._found: set[str] = set()

    def admit(self, module: str) -> None:
        """Let a module be found, by its whole name."""
        self._admitted.add(module.partition(".")[0])

    def find_spec(self, name: str, path: Sequence[str] | None, _: ModuleType | None = None) -> ModuleSpec | None:
        """As the import system asks; submodules are found by the path of their package."""
        if path is not None or not (name in self._admitted or _importer() in self._found):
            return None
        spec = PathFinder.find_spec(name, [self.folder])
        if spec is not None:
            self._found.add(name)
        return spec


def _importer() -> str:
    """The package or module whose code imports something now."""
    frame: FrameType | None = sys._getframe(2)
    while frame is not None:
        name = str(frame.f_globals.get("__name__", "")).partition(".")[0]
        if name not in ("importlib", "_frozen_importlib", "_frozen_importlib_external"):
            return name
        frame = frame.f_back
    return ""


@contextmanager
def own_modules_in(folder: str) -> Iterator[None]:
    """For a while, find in a folder the modules that are named as `module:name`; nowhere if it is empty."""
    before = [finder for finder in sys.meta_path if isinstance(finder, OwnModules)]
    finder = OwnModules(folder)
    for other in before:
        sys.meta_path.remove(other)
    if folder:
        sys.meta_path.append(finder)
    try:
        yield
    finally:
        if folder:
            sys.meta_path.remove(finder)
        sys.meta_path.extend(before)


def folder_of_own_modules() -> str:
    """The folder of `own_modules_in`, for another process; empty without one."""
    return next((finder.folder for finder in sys.meta_path if isinstance(finder, OwnModules)), "")


def admit(module: str) -> None:
    """Say that a person named a module, so that it is found in the folder of `own_modules_in` too."""
    for finder in sys.meta_path:
        if isinstance(finder, OwnModules):
            finder.admit(module)


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
        require_known(kind, given, known, rest=" Or give your own as 'package.module:name'.")
        given = known[given]
    module_name, _, attribute = given.partition(":")
    require(
        module_name and attribute and not module_name.startswith("."),
        f"the {kind} '{given}' is not of the form 'package.module:name'; name a module and what is in it.",
    )
    admit(module_name)
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        raise InputError(
            f"the {kind} '{given}' cannot be imported ({error}); start in the folder of its module, "
            "or put that on PYTHONPATH."
        ) from error
    except (Exception, SystemExit) as error:
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
