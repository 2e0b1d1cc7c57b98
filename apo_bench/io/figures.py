"""Figures of matplotlib with its default settings."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from apo_bench.io.result_files import replace_file


@contextmanager
def use_figure_style(settings: Mapping[str, Any] | None = None) -> Iterator[Any]:
    """Matplotlib with its own settings, and with these, while something is drawn; those of before come back.

    Text is drawn letter by letter: `$` in the name of a method begins no formula. A function that draws has this as a
    decorator or around its body, and imports what it needs of matplotlib inside.
    """
    matplotlib: Any = import_module("matplotlib")
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams["text.parse_math"] = False
        matplotlib.rcParams.update(settings or {})
        yield matplotlib


def save_figure(figure: Any, out: str | Path, *, dpi: int = 100) -> None:
    """Write a figure of matplotlib, as SVG if the file is called so, else as PNG; without date and version.

    Raises:
        InputError: As `replace_file`.
    """
    kind, left_out = ("svg", "Date") if Path(out).suffix.lower() == ".svg" else ("png", "Software")
    with replace_file(out) as file:
        figure.savefig(file, dpi=dpi, format=kind, metadata={left_out: None})
