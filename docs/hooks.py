"""What `mkdocs build` does beside HTML: it writes four pages of the reference, and refuses to load from a network.

The command line, the keys of files, the settings of a trial and the columns of a row are read from the package while
the site is built, so these pages are never older than the code. A page that would load anything from a network is an
error: the site opens offline.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

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
    "reference/row.md": fields.row_page,
}
LOADED = re.compile(
    r"<(?:(?:script|img|iframe|source|video)\b[^>]*\bsrc|link\b[^>]*\bhref)=[\"']?(?:https?:)?//[^>]*>", re.IGNORECASE
)


def on_config(config: Any) -> Any:
    """The settings, without a page that a benchmark has yet to write."""
    there = Path(config.docs_dir)
    for section in config.nav:
        for title, pages in section.items():
            if isinstance(pages, list):
                section[title] = [page for page in pages if page in GENERATED or (there / page).exists()]
    return config


def on_files(files: Files, config: Any) -> Files:
    """The files of the site, with the generated pages."""
    for path, write in GENERATED.items():
        files.append(File.generated(config, path, content=write()))
    return files


def on_post_page(output: str, page: Any, config: Any) -> str:
    """The page as it is.

    Raises:
        PluginError: It loads a script, a style, a font or a picture from another place.
    """
    found = LOADED.search(output)
    if found is not None:
        raise PluginError(f"{page.file.src_path} loads from a network: {found.group()}")
    return output
