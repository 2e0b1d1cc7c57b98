"""Checks of files that a command writes, before it does any work."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from apo_bench.errors import InputError, require
from apo_bench.io import check_target


def check_output(
    path: Path | None, option: str, *endings: str, inputs: tuple[Path, ...] = (), new: bool = False
) -> None:
    """Refuse a file that cannot be written, or that the command also reads; None is no file.

    Args:
        endings: Allowed ends of its name, such as `.png`.
        inputs: Files that the command reads.
        new: Refuse a file that exists.

    Raises:
        InputError: The file is refused.
    """
    if path is None:
        return
    require(
        path.suffix.lower() in endings, f"{option} must be a file name that ends in {' or '.join(endings)}, got {path}."
    )
    if path.parent.is_dir():
        check_target(path)
    writable = path.parent.is_dir() and not path.is_dir() and os.access(path if path.exists() else path.parent, os.W_OK)
    require(writable, f"{option} {path} cannot be written; name a file in a folder that exists and can be written.")
    require(not (new and path.exists()), f"{option} {path} exists already; name another file, or add --overwrite.")
    for source in inputs:
        same = path.exists() and source.exists() and path.samefile(source)
        require(not same, f"{option} {path} is a file that the command reads; name another file.")


@contextmanager
def name_write_errors(target: str = "") -> Iterator[None]:
    """Turn an operating system error into one about `--out FILE`, or about the file that failed."""
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{target or error.filename or 'a file'} cannot be written ({error.strerror}); choose another place."
        ) from error
