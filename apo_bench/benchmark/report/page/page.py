"""Render an HTML page of sections from one template.

The page refers to no other address, and its content security policy lets a browser load none.
"""

import base64
import hashlib
import re
from collections.abc import Sequence
from functools import cache
from importlib import resources
from typing import Any, NamedTuple

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from apo_bench.benchmark.analysis import format_percent, format_percent_interval


class Section(NamedTuple):
    """A section of a page."""

    name: str
    """Its anchor."""
    heading: str
    blocks: Sequence[tuple[str, Any]]
    """Its contents: name of the macro of the template that shows a block, and the argument of the macro."""
    open: bool = False
    """Whether the section is unfolded when the page opens."""


def render_page(title: str, answer: str, lead: Sequence[str], sections: Sequence[Section], trials: str = "") -> str:
    """Return a page as HTML in one piece; text that is not of type `Markup` is escaped.

    Args:
        answer: The sentences at the top, with code in backquotes.
        lead: Paragraphs below the answer.
        trials: The trials, as `pack_trials` packs them.
    """
    script = _read_file("page.js")
    # the policy allows only the script with this hash
    known = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = (
        f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{known}'; "
        "base-uri 'none'; form-action 'none'"
    )
    html = _load_template().render(
        title=title,
        answer=answer,
        lead=lead,
        sections=sections,
        trials=trials,
        script=Markup(script),
        style=Markup(_read_file("page.css")),
        policy=policy,
    )
    return str(html).lstrip()  # macros of the template leave empty lines


def render_prose(text: str) -> Markup:
    """Convert `code` and *emphasis* to HTML as in Markdown; a `%` is kept on the line of its number."""
    code = re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text)).replace(" %", "\u00a0%"))
    return Markup(re.sub(r"\*([^*]+)\*", r"<em>\1</em>", code))


def embed_data(content: bytes, kind: str) -> str:
    """Return bytes as a data URL."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def _embed_svg(text: str) -> str:
    return embed_data(text.encode(), "image/svg+xml")


@cache
def _load_template() -> Any:
    """Load the template of a page, with its filters."""
    environment = Environment(
        loader=PackageLoader("apo_bench.benchmark.report.page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "prose": render_prose,
        "zip": zip,
        "svg": _embed_svg,
        "percent": format_percent,
        "percents": format_percent_interval,
    }
    return environment.get_template("report.html.j2")


@cache
def _read_file(name: str) -> str:
    """Return the text of a style sheet or script in the folder of this module."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
