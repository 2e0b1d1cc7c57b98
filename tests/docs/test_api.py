"""The API reference names every public name once, with its members documented, and its examples print what they say."""

from __future__ import annotations

import dataclasses
import doctest
import inspect
import re
from collections import Counter
from pathlib import Path
from types import ModuleType

import pytest

import apo_bench

PAGES = Path(__file__).parents[2] / "docs" / "api"
ENVIRONMENTS = ("apo_replay.APOReplay", "apo_track.APOTrack", "apo_insert.APOInsert", "apo_assemble.APOAssemble")
"""Classes that Gymnasium makes by their ids."""


def named() -> Counter[str]:
    texts = [page.read_text(encoding="utf-8") for page in sorted(PAGES.glob("*.md"))]
    return Counter(name for text in texts for name in re.findall(r"^::: apo_bench\.(\S+)$", text, re.MULTILINE))


def test_every_public_name_stands_in_the_reference_once() -> None:
    public = {name for name in apo_bench.__all__ if name != "__version__"}
    assert named() == Counter({*public, *(f"envs.{each}" for each in ENVIRONMENTS)})


def is_documented(cls: type, field: str) -> bool:
    """Whether a docstring follows a field in the source of its class."""
    return (
        re.search(rf"^    {field}: .*(?:\n     .*|\n    \))*\n    \"\"\"", inspect.getsource(cls), re.MULTILINE)
        is not None
    )


@pytest.mark.parametrize("name", sorted(name for name in apo_bench.__all__ if name[0].isupper()))
def test_every_field_of_a_public_record_is_documented(name: str) -> None:
    cls = getattr(apo_bench, name)
    assert inspect.getdoc(cls)
    own = inspect.get_annotations(cls) if dataclasses.is_dataclass(cls) else {}
    assert [field for field in own if not field.startswith("_") and not is_documented(cls, field)] == []


@pytest.mark.parametrize(
    "name", sorted(name for name in apo_bench.__all__ if inspect.isfunction(getattr(apo_bench, name)))
)
def test_every_argument_of_a_public_function_is_documented(name: str) -> None:
    function = getattr(apo_bench, name)
    section = (inspect.getdoc(function) or "").split("\nArgs:\n")[-1]
    documented = re.findall(r"^    (\w+): ", section, re.MULTILINE)
    assert [argument for argument in inspect.signature(function).parameters if argument not in documented] == []


def test_every_public_function_has_an_example_in_its_docstring_or_on_its_page() -> None:
    blocks = (re.findall(r"^```python\n(.*?)^```$", page.read_text(), re.M | re.S) for page in PAGES.glob("*.md"))
    shown = "\n".join(text for of_page in blocks for text in of_page)
    functions = [name for name in apo_bench.__all__ if inspect.isfunction(getattr(apo_bench, name))]
    without = [name for name in functions if ">>>" not in (inspect.getdoc(getattr(apo_bench, name)) or "")]
    assert len(functions) > 20
    assert [name for name in without if f"apo_bench.{name}(" not in shown] == []


def examples() -> list[doctest.DocTest]:
    finder = doctest.DocTestFinder(recurse=False)
    public = ((name, getattr(apo_bench, name)) for name in apo_bench.__all__)
    return [
        found
        for name, each in public
        for found in finder.find(each, name, module=ModuleType("none"), globs={})
        if found.examples
    ]


@pytest.mark.parametrize("example", examples(), ids=lambda example: example.name)
def test_examples_of_docstrings_print_what_they_say(example: doctest.DocTest) -> None:
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    assert doctest.DocTestRunner(optionflags=flags).run(example).failed == 0
