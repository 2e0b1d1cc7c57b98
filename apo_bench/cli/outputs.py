"""Files that commands write, checked before any work is done."""

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from apo_bench.errors import InputError, require
from apo_bench.io import check_target

Output = tuple[Path | None, str, tuple[str, ...]]
"""A file to write if any, its option, and the endings that its name may have."""


def check_outputs(outputs: Iterable[Output], inputs: Sequence[Path] = ()) -> None:
    """Refuse files that cannot be written, or that are read as well."""
    for path, option, endings in outputs:
        if path is not None:
            check_writable(path, option, endings)
            read = any(path.exists() and source.exists() and path.samefile(source) for source in inputs)
            require(not read, f"{option} {path} is a file that is read; name another, so that it is kept.")


def check_writable(path: Path, option: str, endings: tuple[str, ...]) -> None:
    """Refuse a file that has another ending or cannot be written."""
    allowed = " or ".join(endings)
    require(
        path.suffix.lower() in endings, f"{option} {path} was given; a file name that ends in {allowed} is allowed."
    )
    writable = path.parent.is_dir() and not path.is_dir()
    if writable:
        check_target(path)
        writable = all(os.access(each, os.W_OK) for each in (path.parent, path) if each.exists())
    require(writable, f"{option} {path} cannot be written; name a file in a folder that exists and can be written.")


@contextmanager
def writing(target: str = "") -> Iterator[None]:
    """Say that something cannot be written, such as `--out FILE`; the file that failed if it is not named."""
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{target or error.filename or 'a file'} cannot be written ({error.strerror}); choose another place."
        ) from error
