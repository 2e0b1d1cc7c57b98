"""Pictures are written here."""

from pathlib import Path
from typing import Any

from apo_bench.errors import InputError


def save_figure(figure: Any, out: str | Path, *, dpi: int = 100, given: str = "") -> None:
    """Write a figure of matplotlib as PNG; `given` is the option that named the file, for the message.

    Raises:
        InputError: The file cannot be written.
    """
    try:
        figure.savefig(out, dpi=dpi, format="png", metadata={"Software": None})
    except OSError as error:
        raise InputError(f"{given}{out} cannot be written ({error.strerror}); choose another place.") from error
