"""Every result file is written here: to a hidden file in the same folder, which then takes the place of the old one.

A write that fails leaves the old file as it was, and nothing is written through a symbolic link. The exception is the
records of a sweep, which are appended line by line (`open_to_append`).
"""

import os
import secrets
import shutil
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from apo_bench.errors import InputError, require
from apo_bench.io.safe_io import kind_of

_PRIVATE = 0o600  # only the owner can read it
_USUAL = 0o666  # less what the umask of the user takes away


@contextmanager
def replace_file(path: str | Path, *, private: bool = False, over: bool = True) -> Iterator[IO[bytes]]:
    """Open a new file that takes the place of `path` at the end of the block, or never if the block fails.

    Args:
        private: Only the owner can read it; else it has the permissions of the file that it replaces.
        over: Replace a file that exists; if not, that one stays.

    Raises:
        InputError: A link or anything else that is no ordinary file has this path, or it cannot be written.
    """
    path = Path(path)
    if over:
        check_target(path)
    part = path.with_name(f".{secrets.token_hex(8)}.part")
    before = _mode(path)
    try:
        if before is not None and over and not os.access(path, os.W_OK):
            raise PermissionError("permission denied")
        with open(part, "x+b", opener=_private if private else _usual) as file:
            if before is not None and not private:
                part.chmod(stat.S_IMODE(before))
            yield file
            file.flush()
            os.fsync(file.fileno())
        if over:
            os.replace(part, path)
        else:
            with suppress(FileExistsError):
                os.link(part, path)
    except OSError as error:
        if isinstance(error, BrokenPipeError) or error.filename not in (None, str(part), str(path)):
            raise
        raise InputError(f"{path} cannot be written ({error.strerror or error}); choose another place.") from error
    finally:
        with suppress(OSError):
            part.unlink()


def write_file(path: str | Path, content: str | bytes, *, private: bool = False, over: bool = True) -> None:
    """Write a file: all of it or nothing; text becomes UTF-8.

    Args:
        private: As in `replace_file`, and so is `over`.

    Raises:
        InputError: As `replace_file`.
    """
    with replace_file(path, private=private, over=over) as file:
        file.write(content.encode("utf-8", "replace") if isinstance(content, str) else content)


def open_to_append(path: Path) -> IO[bytes]:
    """Open an ordinary file, or make it, to read it and to append to it, unbuffered.

    Raises:
        InputError: A link or anything else that is no ordinary file has this path.
        OSError: It cannot be opened.
    """
    check_target(path)
    return open(path, "a+b", buffering=0, opener=_unlinked)


def is_there(file: IO[bytes], path: Path) -> bool:
    """Whether an open file stands where it was opened."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except OSError:
        return False


def put_back(file: IO[bytes], path: Path) -> IO[bytes]:
    """Write what an open file holds to a new one that replaces the file at `path`, if there is one.

    Args:
        file: Of `open_to_append`; it is not closed.

    Returns:
        The new file, as `open_to_append` opens it.

    Raises:
        InputError: As `replace_file`.
        OSError: Its folder cannot be made.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with replace_file(path) as copy:
        file.seek(0)
        shutil.copyfileobj(file, copy)
        copy.flush()
        return open_to_append(Path(copy.name))


def check_target(path: Path) -> None:
    """Raise an `InputError` if something else than an ordinary file stands where one is to be written."""
    mode = _mode(path)
    if mode is not None and not stat.S_ISREG(mode):
        raise InputError(f"{path} is {kind_of(mode)}, and only an ordinary file is written over; remove it.")


def check_folders(folders: Iterable[Path]) -> None:
    """Raise an `InputError` if something else than a folder stands where one is to be, or if in one of them there is
    anything but folders and ordinary files."""
    for folder in folders:
        mode = _mode(folder)
        if mode is None:
            continue
        require(stat.S_ISDIR(mode), f"{folder} is {kind_of(mode)}, where a folder is needed; remove it.")
        for path in sorted(folder.iterdir()):
            inside = _mode(path)
            if inside is not None and not stat.S_ISDIR(inside):
                check_target(path)


def _usual(path: str, flags: int) -> int:
    return os.open(path, flags, _USUAL)


def _private(path: str, flags: int) -> int:
    return os.open(path, flags, _PRIVATE)


def _unlinked(path: str, flags: int) -> int:
    return os.open(path, flags | _flag("O_NOFOLLOW") | _flag("O_NONBLOCK"), _USUAL)


def _flag(name: str) -> int:
    """Zero where the system has no such flag."""
    return int(getattr(os, name, 0))


def _mode(path: Path) -> int | None:
    """The mode of what stands at a path, links not followed; None if nothing does."""
    try:
        return os.lstat(path).st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None
