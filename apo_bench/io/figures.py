"""Figures of matplotlib: drawn as it comes, whatever a `matplotlibrc` in the current folder or at home says.

Text is drawn letter by letter: `$` in the name of somebody's method begins no formula.

Matplotlib reads that of the current folder when it is first imported: its settings change every picture, a file that is
no text is an exception, and a pipe is waited for.
"""

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from apo_bench.io.result_files import replace_file

_READ = "matplotlibrc"


@contextmanager
def default_looks(settings: Mapping[str, Any] | None = None) -> Iterator[Any]:
    """Matplotlib with its own settings, and with these, while something is drawn; those of before come back.

    A function that draws has it as a decorator or around its body, and imports what it needs of matplotlib inside.
    """
    matplotlib = load_matplotlib()
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams["text.parse_math"] = False
        matplotlib.rcParams.update(settings or {})
        yield matplotlib


def load_matplotlib() -> Any:
    """Import matplotlib, from the root folder where the current one has a file of settings."""
    if "matplotlib" not in sys.modules and os.path.lexists(_READ):
        here = Path.cwd()
        os.chdir(here.anchor)
        try:
            import matplotlib
        finally:
            os.chdir(here)
    import matplotlib

    return matplotlib


def save_figure(figure: Any, out: str | Path, *, dpi: int = 100) -> None:
    """Write a figure of matplotlib, as SVG if the file is called so, else as PNG; without date and version.

    Raises:
        InputError: As `replace_file`.
    """
    kind, left_out = ("svg", "Date") if Path(out).suffix.lower() == ".svg" else ("png", "Software")
    with replace_file(out) as file:
        figure.savefig(file, dpi=dpi, format=kind, metadata={left_out: None})
