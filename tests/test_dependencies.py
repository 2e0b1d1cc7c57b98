"""What is installed is what is imported, and each dependency says from which version on it works."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterable
from importlib.metadata import Distribution, distribution
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from benchmarks.lowest import EXTRAS, lowest

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
BROUGHT = {"glfw": "mujoco", "OCP": "build123d", "PIL": "imageio"}
"""What a dependency needs itself whenever we do: its viewer and its renderer without EGL; its kernel;
its pictures."""
ASKED_FOR = {"robosuite"}
"""Looked for and never needed: its arms, where somebody has installed it."""
MOST = {True: (65, 750), False: (50, 600)}
"""Whether dm-control comes along -> how many packages there may be, and how many MB."""


def imported() -> set[str]:
    """The outer packages that any file of this one imports."""
    names = set()
    for path in (ROOT / "apo_bench").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names.add(str(node.module).split(".")[0])
            elif isinstance(node, ast.Call) and _called(node.func) in ("import_module", "find_spec"):
                names |= {str(a.value).split(".")[0] for a in node.args if isinstance(a, ast.Constant)}
    return names - {*sys.stdlib_module_names, "apo_bench"}


def _called(function: ast.expr) -> str:
    """`find_spec` of `find_spec(...)` and of `importlib.util.find_spec(...)`."""
    return getattr(function, "attr", getattr(function, "id", ""))


def installed(requirements: list[str]) -> dict[str, Distribution]:
    """What pip installs for these requirements, by the metadata of what is installed here: name -> package."""
    found: dict[str, Distribution] = {}
    seen: set[tuple[str, str]] = set()
    left = [(Requirement(each), "") for each in requirements]
    while left:
        wanted, of = left.pop()
        if wanted.marker is not None and not wanted.marker.evaluate({"extra": of}):
            continue
        name = canonicalize_name(wanted.name)
        for extra in {"", *wanted.extras} - {extra for known, extra in seen if known == name}:
            seen.add((name, extra))
            found[name] = distribution(wanted.name)
            left += [(Requirement(each), extra) for each in found[name].requires or ()]
    return found


def megabytes(packages: Iterable[Distribution]) -> float:
    files = (Path(str(each.locate_file(file))) for each in packages for file in each.files or ())
    return sum(file.stat().st_size for file in files if file.is_file()) / 1e6


def stated(*lists: list[str]) -> set[str]:
    """The import names of dependencies."""
    return {re.split(r"[\[<>=]", each)[0].replace("-", "_") for names in lists for each in names}


def test_what_is_imported_is_stated_and_what_is_stated_is_imported() -> None:
    extras = PROJECT["optional-dependencies"]
    optional = stated(*(extras[name] for name in ("cad", "ray", "view", "dm", "data", "film", "range", "tables")))
    assert stated(PROJECT["dependencies"]) == imported() - optional - set(BROUGHT) - ASKED_FOR
    assert optional <= imported() | {BROUGHT[each] for each in set(BROUGHT) & imported()}
    assert {*BROUGHT.values()} <= stated(PROJECT["dependencies"]) | optional


def test_what_comes_along_is_little() -> None:
    came = installed(PROJECT["dependencies"])
    most, most_mb = MOST["dm-control" in came]
    assert {"mujoco", "numpy", "scipy"} <= came.keys()
    assert not {"pyarrow", "imageio-ffmpeg", "h5py"} & came.keys(), "these are of extras"
    assert len(came) + 1 < most, sorted(came)
    assert megabytes(came.values()) < most_mb, {name: megabytes([each]) for name, each in came.items()}


def test_every_dependency_says_from_which_version_on_it_works(tmp_path: Path) -> None:
    assert "scipy==1.16" in lowest(ROOT / "pyproject.toml")
    extras = [PROJECT["optional-dependencies"][extra] for extra in EXTRAS]
    bounds = [bound.split("==")[0] for bound in lowest(ROOT / "pyproject.toml")]
    assert {bound.replace("-", "_") for bound in bounds} == stated(PROJECT["dependencies"], *extras)
    assert len(bounds) == len(set(bounds)), "one version of each, also where a bound depends on the version of Python"
    path = tmp_path / "pyproject.toml"
    path.write_text(
        '[project]\ndependencies = ["a>=1.2,<3", "b[c]>=4", "d"]\n'
        "optional-dependencies = {dm = [], data = [], film = [], range = []}\n"
    )
    with pytest.raises(ValueError, match="'d' states no version"):
        lowest(path)
    path.write_text(path.read_text().replace(', "d"', ""))
    assert lowest(path) == ["a==1.2", "b==4"]
