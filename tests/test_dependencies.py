"""What is installed is what is imported, and each dependency says from which version on it works."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from pathlib import Path

import pytest

from benchmarks.lowest import EXTRAS, lowest

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
BROUGHT = {"glfw": "mujoco", "OCP": "build123d", "PIL": "imageio"}
"""What a dependency needs itself whenever we do: its viewer and its renderer without EGL; its kernel;
its pictures."""
ALONGSIDE = {"dm_control"}
"""Stated and not imported: for who works with it and `to_dm_env`, where it installs."""


def imported() -> set[str]:
    """The outer packages that any file of this one imports."""
    names = set()
    for path in (ROOT / "apo_bench").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names.add(str(node.module).split(".")[0])
            elif isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "import_module":
                names |= {str(a.value).split(".")[0] for a in node.args if isinstance(a, ast.Constant)}
    return names - {*sys.stdlib_module_names, "apo_bench"}


def stated(*lists: list[str]) -> set[str]:
    """The import names of dependencies."""
    return {re.split(r"[\[<>=]", each)[0].replace("-", "_") for names in lists for each in names}


def test_what_is_imported_is_stated_and_what_is_stated_is_imported() -> None:
    extras = PROJECT["optional-dependencies"]
    optional = stated(*(extras[name] for name in ("fast", "cad", "ray", "view", "dm", "data")))
    assert stated(PROJECT["dependencies"]) - ALONGSIDE == imported() - optional - set(BROUGHT)
    assert optional <= imported() | {BROUGHT[each] for each in set(BROUGHT) & imported()}
    assert {*BROUGHT.values()} <= stated(PROJECT["dependencies"]) | optional


def test_every_dependency_says_from_which_version_on_it_works(tmp_path: Path) -> None:
    assert "scipy==1.16" in lowest(ROOT / "pyproject.toml")
    extras = [PROJECT["optional-dependencies"][extra] for extra in EXTRAS]
    bounds = [bound.split("==")[0] for bound in lowest(ROOT / "pyproject.toml")]
    assert {bound.replace("-", "_") for bound in bounds} == stated(PROJECT["dependencies"], *extras)
    assert len(bounds) == len(set(bounds)), "one version of each, also where a bound depends on the version of Python"
    path = tmp_path / "pyproject.toml"
    path.write_text(
        '[project]\ndependencies = ["a>=1.2,<3", "b[c]>=4", "d"]\noptional-dependencies = {fast = [], dm = []}\n'
    )
    with pytest.raises(ValueError, match="'d' states no version"):
        lowest(path)
    path.write_text(path.read_text().replace(', "d"', ""))
    assert lowest(path) == ["a==1.2", "b==4"]
