"""Hooks of `mkdocs build`: pages of the reference from the code, formulas as MathML, and nothing from a network.

The command line, the keys of files, the settings and the record of a trial are read from the package while the site is
built, so these pages are never older than the code. A page that would load anything from a network is an error: the
site opens offline. Formulas, `$..$` and `$$..$$` as on GitHub, become MathML, which browsers render themselves.
"""

from __future__ import annotations

import html
import re
import sys
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1])]

import command_line
import fields
import file_keys

GENERATED = {
    "reference/command-line.md": command_line.page,
    "reference/files.md": file_keys.page,
    "reference/settings.md": fields.settings_page,
    "reference/trial-record.md": fields.record_page,
}
LOADED = re.compile(
    r"<(?:(?:script|img|iframe|source|video)\b[^>]*\bsrc|link\b[^>]*\bhref)=[\"']?(?:https?:)?//[^>]*>", re.IGNORECASE
)

SHORT = re.compile(r"<code>([^<\s]{1,20})</code>")
FORMULA = re.compile(r"<(?P<tag>span|div) class=\"arithmatex\">\\[(\[](?P<latex>.*?)\\[)\]]</(?P=tag)>", re.DOTALL)


def on_files(files: Files, config: Any) -> Files:
    """The files of the site, with the generated pages."""
    for path, write in GENERATED.items():
        files.append(File.generated(config, path, content=write()))
    return files


def on_page_content(content: str, page: Any, config: Any, files: Files) -> str:
    """The page with its formulas as MathML: those in lines as they come, those alone as blocks that scroll.

    Short names in code are marked, so that none is broken at a hyphen in a table.
    """

    def typeset(formula: re.Match[str]) -> str:
        block = formula["tag"] == "div"
        mathml = convert(html.unescape(formula["latex"]).strip(), display="block" if block else "inline")
        return f'<div class="formula">{mathml}</div>' if block else mathml

    return SHORT.sub(r'<code class="whole">\1</code>', FORMULA.sub(typeset, content))


def on_post_page(output: str, page: Any, config: Any) -> str:
    """The page as it is.

    Raises:
        PluginError: It loads a script, a style, a font or a picture from another place.
    """
    found = LOADED.search(output)
    if found is not None:
        raise PluginError(f"{page.file.src_path} loads from a network: {found.group()}")
    return output
