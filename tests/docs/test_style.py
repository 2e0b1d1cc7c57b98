"""Help texts, public docstrings, error messages and pages use plain technical words."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer

import apo_bench
from apo_bench.cli.app import app

PACKAGE = Path(apo_bench.__file__).parent
DOCS = Path(__file__).parents[2] / "docs"
FORBIDDEN = re.compile(
    r"\b(shall|whoever|anew|besides?|foretell\w*|mend(s|ed|ing)?|of its own|of one's own|comes? along|nobody asks"
    r"|careless\w*|by heart|salt(ed)?|the eye)\b",
    re.IGNORECASE,
)
"""Words that the documentation of Gymnasium and mink would not use, and words that this package used before."""
OLD_WORDS = re.compile(
    r"\b(alike|foretold|mouths?|way in|believe[sd]?|ghosts?|drafting|nests|feels|felt)\b", re.IGNORECASE
)
"""Words that pages used before for: equally, predicted, hole entrance, insertion axis, estimated, overlay, probing."""
QUESTION = re.compile(r"^#+ ((?:What|Whether|Where|Which|Who|When|How) .*)$", re.MULTILINE)
SHEETS = ("docs/reference/noise-models.md", "docs/reference/scenarios.md")
"""Pages of generated sheets, whose texts are those of scenario files and of noise models."""
MOST_WORDS = 900
"""Of a page, outside of tables, code and formulas."""
MOST_IN_ALL = 60_000
"""Of README and all pages, tables and code included."""


def help_texts() -> Iterator[tuple[str, str]]:
    todo = [("apo-bench", typer.main.get_command(app))]
    while todo:
        name, command = todo.pop()
        yield name, command.help or ""
        yield from ((f"{name} {each.name}", getattr(each, "help", None) or "") for each in command.params)
        todo += [(f"{name} {key}", each) for key, each in getattr(command, "commands", {}).items()]


def public_docstrings() -> Iterator[tuple[str, str]]:
    for name in apo_bench.__all__:
        public = getattr(apo_bench, name)
        if inspect.isclass(public):
            members = inspect.getmembers(public, lambda each: inspect.isfunction(each) or isinstance(each, property))
            own = [(key, each) for key, each in members if not key.startswith("_")]
            yield from ((f"{name}.{key}", inspect.getdoc(each) or "") for key, each in own)
        yield name, inspect.getdoc(public) or ""


def messages() -> Iterator[tuple[str, str]]:
    """Texts in the calls that raise an error."""
    for path in sorted(PACKAGE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            called = node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else ""
            if called in ("require", "InputError", "ArgumentError"):
                for text in ast.walk(node):
                    if isinstance(text, ast.Constant) and isinstance(text.value, str):
                        yield f"{path.relative_to(PACKAGE)}:{text.lineno}", text.value


def pages() -> Iterator[tuple[str, str]]:
    for path in (DOCS.parent / "README.md", DOCS.parent / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))):
        yield str(path.relative_to(DOCS.parent)), path.read_text(encoding="utf-8")


@pytest.mark.parametrize("texts", [help_texts, public_docstrings, messages, pages])
def test_texts_for_users_are_plain(texts: type[Iterator[tuple[str, str]]]) -> None:
    assert [(where, found[0]) for where, text in texts() if (found := FORBIDDEN.search(text))] == []


def prose(text: str) -> str:
    """Return a page without its tables, blocks of code and formulas."""
    plain = re.sub(r"^```.*?^```$|\$\$.*?\$\$|\$[^$\n]+\$", "", text, flags=re.MULTILINE | re.DOTALL)
    return "\n".join(line for line in plain.splitlines() if not line.startswith("|"))


def test_pages_do_not_use_words_of_before() -> None:
    written = ((where, prose(text)) for where, text in pages() if where not in SHEETS)
    assert [(where, found[0]) for where, text in written if (found := OLD_WORDS.search(text))] == []


def test_headings_are_noun_phrases_or_imperatives() -> None:
    assert [(where, found) for where, text in pages() for found in QUESTION.findall(prose(text))] == []


def test_pages_are_short() -> None:
    counts = {where: len(prose(text).split()) for where, text in pages() if where not in SHEETS}
    assert {where: count for where, count in counts.items() if count > MOST_WORDS} == {}
    assert sum(len(text.split()) for _, text in pages()) <= MOST_IN_ALL


def test_guides_begin_with_what_the_reader_can_do_and_how() -> None:
    """Before the first heading stands a sentence of what the reader has or can do, and code, a command or a table."""
    guides = {where: text.split("\n## ")[0] for where, text in pages() if where.startswith("docs/guide/")}
    assert len(guides) > 20
    assert [where for where, text in guides.items() if not text.split("\n\n")[1].startswith("After this page")] == []
    shown = re.compile(r"^(```|\|)", re.MULTILINE)
    assert [where for where, text in guides.items() if not shown.search(text)] == [
        "docs/guide/programs.md",
        "docs/guide/templates.md",
    ]
