"""Draw and save figures with matplotlib's default settings, whatever the user's are."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from apo_bench.io.result_files import replace_file


@contextmanager
def use_figure_style(settings: Mapping[str, Any] | None = None) -> Iterator[Any]:
    """Draw with matplotlib's defaults and these settings; the user's settings are restored afterwards.

    Text is drawn literally: `$` in the name of a method begins no formula. Use it as a decorator or around the body of
    a function that draws, and import matplotlib's modules inside.
    """
    matplotlib: Any = import_module("matplotlib")
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams["text.parse_math"] = False
        matplotlib.rcParams.update(settings or {})
        yield matplotlib


def save_figure(figure: Any, out: str | Path, *, dpi: int = 100) -> None:
    """Write a figure of matplotlib, as SVG if the name ends in `.svg`, else as PNG; without date and version.

    Raises:
        InputError: As `replace_file`.
    """
    kind, left_out = ("svg", "Date") if Path(out).suffix.lower() == ".svg" else ("png", "Software")
    with replace_file(out) as file:
        figure.savefig(file, dpi=dpi, format=kind, metadata={left_out: None})
