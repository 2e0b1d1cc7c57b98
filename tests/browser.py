"""A page in a headless browser without a network."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


class Opened(NamedTuple):
    """A page, and what it said and asked for while it was open."""

    page: Any
    said: list[str]
    asked: list[str]


@contextmanager
def browser() -> Iterator[Any]:
    """Chromium as it is installed; without one the test is skipped."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = next((found for name in NAMES if (found := shutil.which(name))), None)
    if path is None:
        pytest.skip(f"no browser: none of {', '.join(NAMES)} is installed")
    with playwright.sync_playwright() as p:
        started = p.chromium.launch(executable_path=path, args=["--no-sandbox"])
        try:
            yield started
        finally:
            started.close()


@contextmanager
def opened(started: Any, page: Path, width: int = 1280, dark: bool = False, anchor: str = "") -> Iterator[Opened]:
    """The page as it is after it was loaded."""
    scheme = "dark" if dark else "light"
    context = started.new_context(viewport={"width": width, "height": 900}, offline=True, color_scheme=scheme)
    tab = context.new_page()
    said: list[str] = []
    asked: list[str] = []
    tab.on("console", lambda message: said.append(message.text))
    tab.on("pageerror", lambda error: said.append(str(error)))
    tab.on("request", lambda request: asked.append(request.url))
    tab.goto(f"{page.resolve().as_uri()}{anchor}")
    try:
        yield Opened(tab, said, asked)
    finally:
        context.close()


def overflow(page: Any) -> int:
    """By how many px the page is wider than its window."""
    return int(page.evaluate("document.documentElement.scrollWidth - window.innerWidth"))
