"""Style sheets and scripts that lie beside this module."""

from __future__ import annotations

from functools import cache
from importlib import resources


@cache
def page_file(name: str) -> str:
    """The text of `chart.css`, `page.css` or `page.js`."""
    return resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
