"""A whole page: one file, no address outside it, and a policy that lets a browser load none."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from apo_bench.report.figures.paint import palette
from apo_bench.report.page.files import page_file
from apo_bench.report.page.markup import Html, joined, tag


class Section(NamedTuple):
    """A part of a page with a heading."""

    name: str
    """Its anchor."""
    title: str
    body: Html


def document(
    title: str,
    lead: Html,
    sections: Sequence[Section],
    methods: Sequence[str],
    data: Mapping[str, Html] | None = None,
) -> str:
    """HTML, in one piece.

    Args:
        methods: Those that have a colour.
        data: Packed values for the script, by name.
    """
    script = page_file("page.js")
    links = tag("ul", *(tag("li", tag("a", s.title, href=f"#{s.name}")) for s in sections))
    body = [
        tag("a", "To the results", href=f"#{sections[0].name}", class_="skip"),
        tag("header", tag("h1", title), lead, tag("nav", links, aria_label="sections")),
        tag("main", *(tag("section", tag("h2", s.title, id=s.name), s.body) for s in sections)),
        *(tag("script", values, type="text/plain", id=name) for name, values in (data or {}).items()),
        tag("script", Html(script)),
    ]
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n{_policy(script)}\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"{tag('title', title)}\n<style>{_style(methods)}</style>\n</head>\n"
        f"<body>\n{joined(body, chr(10))}\n</body>\n</html>\n"
    )


def _style(methods: Sequence[str]) -> str:
    light, dark = palette(methods)
    own = f":root{{{light}}}@media (prefers-color-scheme:dark){{:root{{{dark}}}}}"
    return page_file("chart.css") + page_file("page.css") + own


def _policy(script: str) -> str:
    """Nothing is fetched, and no script runs but ours."""
    known = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    rule = f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{known}'"
    return f"<meta http-equiv=\"Content-Security-Policy\" content=\"{rule}; base-uri 'none'; form-action 'none'\">"
