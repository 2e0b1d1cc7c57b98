"""Check the files that a command is to write, before it does any work."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from apo_bench.errors import InputError, require
from apo_bench.io import check_target


def check_output(
    path: Path | None, option: str, *endings: str, inputs: tuple[Path, ...] = (), new: bool = False
) -> None:
    """Check a file that the command is to write; None is no file.

    Args:
        option: Name of the option, for the message.
        endings: Allowed endings of the file name, such as `.png`.
        inputs: Files that the command reads, which it may not overwrite.
        new: Whether the file must not exist.

    Raises:
        InputError: The file cannot be written, or must not be.
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
    """Turn an `OSError` into an `InputError` about the target, such as `--out FILE`, or about the file that failed."""
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{target or error.filename or 'a file'} cannot be written ({error.strerror}); choose another place."
        ) from error
