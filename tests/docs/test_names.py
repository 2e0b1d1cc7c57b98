"""Public functions begin with a verb, public types are nouns, and a name means one thing in the whole package.

`python tests/docs/test_names.py` prints the numbers of public names and the exceptions.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import re
from collections import defaultdict
from pathlib import Path
from typing import Any

import apo_bench

PACKAGE = Path(apo_bench.__file__).parent
VERBS = frozenset(
    re.findall(
        r"\w+",
        """add aim align allow bore bound build carry check choose classify clean collect complete comply compute
    concatenate contrast convert copy correct correlate count decode demonstrate depart descend describe detect draw
    enclose escape evaluate explain extrude factor filter find finish fit flatten floor follow format freeze generate
    get group import interpolate intersect invert join judge linearise list load make measure merge move name normalise
    observe open parse place plan pool press print project rank read recede redirect refuse release remember replace
    replay resolve restore revolve round run save say servo set settle shorten show shrink simplify smooth solve spell
    spread straighten summarise switch tabulate take tally translate unpack unwhiten use wait wake weld whiten write
    zero""",
    )
)
FUNCTIONS = {"to_dm_env": "conversions are named as `to_numpy` and `to_pandas` are"}
TYPES = {
    "CorrectPoses": "wrappers are named as those of Gymnasium, such as ClipAction",
    "ExecutionAborted": "an error names what happened",
    "Flatten": "wrappers are named as those of Gymnasium, such as FlattenObservation",
}
NOUNS = ("Interval", "Ring", "Seed", "Table", "Trial")
"""Nouns with the ending of an adjective or a participle."""
ALSO_NOUNS = ("bore", "contrast", "group", "move", "plan", "replay", "round")
"""Verbs of functions that are nouns as well."""
ADJECTIVE = re.compile(r"(ed|ing|ic|al|able|ous|ive)$")


def exported() -> dict[str, Any]:
    """Functions and classes that a package exports by its `__init__`."""
    names = dict[str, Any]()
    packages = [each.name for each in pkgutil.walk_packages(apo_bench.__path__, "apo_bench.") if each.ispkg]
    for package in ("apo_bench", *packages):
        module = importlib.import_module(package)
        own = [name for name, value in vars(module).items() if getattr(value, "__module__", "") == package]
        names |= {name: getattr(module, name) for name in getattr(module, "__all__", own) if not name.startswith("_")}
    return {name: value for name, value in names.items() if inspect.isclass(value) or is_function(value)}


def is_function(value: Any) -> bool:
    return callable(value) and inspect.isfunction(inspect.unwrap(value))


def is_question(function: Any) -> bool:
    """A function that answers yes or no is named as the statement: `is_rigid`, `faces_oppose`."""
    return function.__name__.startswith("is_") or inspect.signature(function).return_annotation in (bool, "bool")


def functions_without_verb() -> set[str]:
    found = {name: value for name, value in exported().items() if not inspect.isclass(value)}
    return {name for name, value in found.items() if name.split("_")[0] not in VERBS and not is_question(value)}


def types_without_noun() -> set[str]:
    found = {name for name, value in exported().items() if inspect.isclass(value)}
    first = {name: re.split(r"(?<=[a-z])(?=[A-Z])", name)[0].lower() for name in found}
    verbs = {name for name, word in first.items() if word in VERBS and word not in ALSO_NOUNS}
    return {name for name in found if ADJECTIVE.search(name) and not name.endswith(NOUNS)} | verbs


def definitions() -> dict[str, list[str]]:
    """Public classes and functions of all modules: name -> the modules that define it."""
    found = defaultdict[str, list[str]](list)
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith("_"):
                found[node.name].append(str(path.relative_to(PACKAGE)))
    return found


def test_public_functions_begin_with_a_verb() -> None:
    assert functions_without_verb() == set(FUNCTIONS)


def test_public_types_are_nouns() -> None:
    assert types_without_noun() == set(TYPES)


def test_a_public_name_has_one_meaning() -> None:
    assert {name: modules for name, modules in definitions().items() if len(modules) > 1} == {}


if __name__ == "__main__":
    print(f"{len(apo_bench.__all__)} names of apo_bench, {len(exported())} of its packages")
    for name, reason in sorted({**FUNCTIONS, **TYPES}.items()):
        print(f"{name}: {reason}")
