"""The site: formulas are typeset without a script, and nothing is cut in a window of 1280 px or on a phone."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.browser import browser, opened, overflow

ROOT = Path(__file__).parents[2]
PAGES = (
    *("index", "guide/environment", "guide/from-cad", "how/judge", "how/contact", "how/paper"),
    *("results/headline", "results/arms", "reference/files", "reference/settings", "api/running", "api/environments"),
)
CUT = """() => [...document.querySelectorAll('pre > code, .md-typeset__scrollwrap, .formula')]
    .filter(e => e.scrollWidth > e.clientWidth + 1 && e.clientWidth > 0).map(e => e.innerText.slice(0, 80))"""
"""The beginnings of what is wider than its room."""
BROKEN = "() => [...document.querySelectorAll('td code.whole')].filter(e => e.getClientRects().length > 1).length"
"""How many short names in tables go over two lines."""


@pytest.fixture(scope="module")
def hooks() -> Any:
    spec = importlib.util.spec_from_file_location("hooks", ROOT / "docs" / "hooks.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from mkdocs.commands.build import build
    from mkdocs.config import load_config

    folder = tmp_path_factory.mktemp("site")
    build(load_config(str(ROOT / "mkdocs.yml"), site_dir=str(folder), strict=True))
    return folder


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser() as started:
        yield started


def test_formulas_become_mathml_in_lines_and_alone(hooks: Any) -> None:
    inline = hooks.on_page_content(r'<p>If <span class="arithmatex">\(a &lt; b\)</span>.</p>', None, None, None)
    alone = hooks.on_page_content(r'<div class="arithmatex">\[z = 1\]</div>', None, None, None)
    assert inline.startswith("<p>If <math ")
    assert "&#x0003C;" in inline
    assert alone.startswith('<div class="formula"><math ')
    assert 'display="block"' in alone


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES)
def test_nothing_is_cut_in_a_usual_window_and_no_page_is_wider_than_a_phone(
    site: Path, chromium: Any, page: str
) -> None:
    with opened(chromium, site / f"{page}.html", 1280) as shown:
        assert shown.page.evaluate(CUT) == []
        assert shown.page.evaluate(BROKEN) == 0
        assert overflow(shown.page) <= 0
        assert "\\(" not in shown.page.inner_text("article")
    with opened(chromium, site / f"{page}.html", 390) as shown:
        assert overflow(shown.page) <= 0


@pytest.mark.slow
def test_the_formulas_of_the_corrector_are_mathml(site: Path) -> None:
    assert (site / "how" / "contact.html").read_text(encoding="utf-8").count("<math ") > 15
