"""Files are written here: ordinary ones only, and never through a link; one that was removed meanwhile is put back."""

import os
import secrets
import shutil
import stat
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from apo_bench.errors import InputError, require

_KINDS = (
    (stat.S_ISLNK, "a symbolic link"),
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISREG, "a file"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def to_write(path: Path, mode: str = "wb", buffering: int = -1) -> IO[Any]:
    """Open an ordinary file to write it; `mode` and `buffering` as `open` takes them, text is UTF-8.

    Raises:
        InputError: A link or anything else that is no ordinary file stands there.
        OSError: It cannot be opened.
    """
    check_target(path)
    text = {} if "b" in mode else {"encoding": "utf-8", "errors": "replace", "newline": ""}
    return open(path, mode, buffering, opener=_unlinked, **text)  # type: ignore[call-overload]


def write_whole(path: Path, text: str, *, over: bool = True) -> None:
    """Write a file that only its owner can read: all of it or nothing, and never through a link.

    Args:
        over: Take the place of a file that stands there; if not, that one is left as it is.

    Raises:
        OSError: It cannot be written.
    """
    beside = path.with_name(f".{path.name}.{secrets.token_hex(8)}")
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _flag("O_CLOEXEC")
    try:
        with os.fdopen(os.open(beside, flags, 0o600), "w", encoding="utf-8", newline="") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        if over:
            os.replace(beside, path)
        else:
            with suppress(FileExistsError):
                os.link(beside, path)
    finally:
        beside.unlink(missing_ok=True)


def is_there(file: IO[bytes], path: Path) -> bool:
    """Whether an open file stands where it was opened."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except OSError:
        return False


def put_back(file: IO[bytes], path: Path) -> IO[Any]:
    """Write what an open file holds to a new one at `path`, at once, in place of whatever stands there.

    Args:
        file: Opened in the mode `a+b`; it is not closed.

    Returns:
        The new file, in the same mode.

    Raises:
        OSError: It cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f"{path.name}.new")
    beside.unlink(missing_ok=True)
    with beside.open("xb") as copy:
        file.seek(0)
        shutil.copyfileobj(file, copy)
    kept = beside.open("a+b", buffering=0)
    try:
        os.replace(beside, path)
    except BaseException:
        kept.close()
        raise
    return kept


def check_target(path: Path) -> None:
    """Raise an `InputError` if something else than an ordinary file stands where one is to be written."""
    mode = _mode(path)
    if mode is not None and not stat.S_ISREG(mode):
        raise InputError(f"{path} is {_kind(mode)}, and only an ordinary file is written over; remove it.")


def check_folders(folders: Iterable[Path]) -> None:
    """Raise an `InputError` if something else than a folder stands where one is to be, or if in one of them there is
    anything but folders and ordinary files."""
    for folder in folders:
        mode = _mode(folder)
        if mode is None:
            continue
        require(stat.S_ISDIR(mode), f"{folder} is {_kind(mode)}, where a folder is needed; remove it.")
        for path in sorted(folder.iterdir()):
            inside = _mode(path)
            if inside is not None and not stat.S_ISDIR(inside):
                check_target(path)


def _unlinked(path: str, flags: int) -> int:
    return os.open(path, flags | _flag("O_NOFOLLOW") | _flag("O_NONBLOCK"), 0o666)


def _mode(path: Path) -> int | None:
    """The mode of what stands at a path, links not followed; None if nothing does."""
    try:
        return os.lstat(path).st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None


def _kind(mode: int) -> str:
    return next((name for is_kind, name in _KINDS if is_kind(mode)), "something else")


def _flag(name: str) -> int:
    """Zero where the system has no such flag."""
    return int(getattr(os, name, 0))
