"""Version, date and range of Python are the same wherever they are stated."""

from __future__ import annotations

import datetime
import re
import tomllib
from pathlib import Path

import pytest

import apo_bench
from benchmarks.lowest import OLDEST
from benchmarks.provenance import with_mujoco

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
SUPPORTED = ("3.11", "3.12", "3.13", "3.14")
NEXT = "3.15"
WITHOUT_WHEELS = "daqp, manifold3d and ray have no wheels for "
WORKFLOWS = {path.stem: path.read_text(encoding="utf-8") for path in (ROOT / ".github" / "workflows").glob("*.yml")}
PAGES = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "Makefile", "docs/index.md", "docs/guide/installing.md")


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def ranges(said: str) -> set[tuple[str, str]]:
    """Every `Python 3.A to 3.B` of a text."""
    return set(re.findall(r"Python (3\.\d+) to (3\.\d+)", said))


def released() -> tuple[str, datetime.date]:
    """The newest version of the changelog, and its day."""
    found = re.search(r"^## (\S+) \((\d{4}-\d\d-\d\d)\)$", text("CHANGELOG.md"), re.MULTILINE)
    assert found is not None
    return found[1], datetime.date.fromisoformat(found[2])


def test_the_version_stands_in_one_place_and_what_repeats_it_agrees() -> None:
    assert "version" not in PROJECT["project"]
    assert PROJECT["project"]["dynamic"] == ["version"]
    assert PROJECT["tool"]["hatch"]["version"] == {"path": "apo_bench/__init__.py"}
    version, _ = released()
    assert version == apo_bench.__version__
    assert re.findall(r"^version: (.*)$", text("CITATION.cff"), re.MULTILINE) == [version]
    assert re.findall(r"version = \{(.*)\}", text("README.md")) == [version]


def test_the_day_of_the_release_is_one_day() -> None:
    _, day = released()
    assert re.findall(r"^date-released: (.*)$", text("CITATION.cff"), re.MULTILINE) == [day.isoformat()]
    assert re.findall(r"year    = \{(\d+)\}", text("README.md")) == [str(day.year)]
    assert re.findall(r"month   = (\w+)", text("README.md")) == [f"{day:%b}".lower()]


def test_the_range_of_python_is_the_same_everywhere() -> None:
    project = PROJECT["project"]
    assert project["requires-python"] == f">={SUPPORTED[0]},<{NEXT}"
    prefix = "Programming Language :: Python :: "
    assert [each.removeprefix(prefix) for each in project["classifiers"] if "Python :: 3." in each] == [*SUPPORTED]
    for name in PAGES:
        assert ranges(text(name)) == {(SUPPORTED[0], SUPPORTED[-1])}, name
    assert f"(3, {SUPPORTED[0][2:]}) <= sys.version_info < (3, {NEXT[2:]})" in text("Makefile")
    assert PROJECT["tool"]["mypy"]["python_version"] == SUPPORTED[0]
    assert PROJECT["tool"]["ruff"]["target-version"] == f"py{SUPPORTED[0].replace('.', '')}"
    assert ".".join(map(str, OLDEST)) == SUPPORTED[0]


@pytest.mark.parametrize("name", ["ci", "release"])
def test_workflows_try_every_python(name: str) -> None:
    matrices = re.findall(r"^ +python: \[(.*)\]$", WORKFLOWS[name], re.MULTILINE)
    assert matrices == [", ".join(f'"{each}"' for each in SUPPORTED)]


@pytest.mark.parametrize(
    "name", ["Makefile", "README.md", "CONTRIBUTING.md", "docs/index.md", "docs/guide/installing.md"]
)
def test_the_python_that_is_refused_is_refused_with_the_reason_in_one_line(name: str) -> None:
    (line,) = [line for line in text(name).splitlines() if WITHOUT_WHEELS in line]
    assert NEXT in line


def test_results_say_which_mujoco_they_were_simulated_with() -> None:
    silent = [
        page.stem
        for page in (ROOT / "docs" / "results").glob("*.md")
        if not re.search(r"MuJoCo \d+\.\d+\.\d+", page.read_text(encoding="utf-8"))
    ]
    assert silent == []
    said = with_mujoco("# A page\n\nText.\n", ["3.17.0", "4.0.0"])
    assert said == "# A page\n\nText.\n\n*Simulated with MuJoCo 3.17.0 and 4.0.0.*\n"


def test_mujoco_4_waits_where_dm_control_comes_along() -> None:
    """Its last version does not know MuJoCo 4."""
    stated = PROJECT["project"]["dependencies"]
    (where,) = [each.split("; ")[1] for each in stated if each.startswith("dm-control")]
    assert [each for each in stated if each.startswith("mujoco")] == [
        f"mujoco>=3.17,<4; {where}",
        f"mujoco>=3.17,<5; {where.replace('<', '>=')}",
    ]
