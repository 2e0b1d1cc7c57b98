"""Pages out of templates: one file, no address outside it, and a policy that lets a browser load none."""

import base64
import hashlib
import re
from functools import cache
from importlib import resources
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from apo_bench.report.figures.styles import dark_properties


def page(template: str, **values: Any) -> str:
    """HTML in one piece; whatever is not markup by its type is escaped.

    Args:
        template: `report.html` or `compare.html`.
        values: For the template: `title`, `sections` (anchor -> heading), and what it needs itself.
    """
    script = _file("page.js")
    dark = f"@media (prefers-color-scheme:dark){{:root{{{dark_properties()}}}}}"
    known = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = (
        f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{known}'; "
        "base-uri 'none'; form-action 'none'"
    )
    return (
        _templates()
        .get_template(f"{template}.j2")
        .render(script=Markup(script), style=Markup(_file("page.css") + dark), policy=policy, **values)
    )


def prose(text: str) -> Markup:
    """Sentences in which `code` and *emphasis* are marked as in Markdown; `%` stays with its number."""
    code = re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text)).replace(" %", "\u00a0%"))
    return Markup(re.sub(r"\*([^*]+)\*", r"<em>\1</em>", code))


@cache
def _templates() -> Environment:
    environment = Environment(
        loader=PackageLoader("apo_bench.report.page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"prose": prose, "zip": zip}
    return environment


@cache
def _file(name: str) -> str:
    """A style sheet or script that lies beside this module."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
