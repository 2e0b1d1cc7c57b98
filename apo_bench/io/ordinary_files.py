"""Files are opened and written here: ordinary ones only, none larger than allowed, text in UTF-8, never through a link.

Nothing but an ordinary file is waited for; what is written never goes through a link, and a file that was removed
meanwhile is put back.
"""

import os
import secrets
import shutil
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, BinaryIO

from apo_bench.errors import InputError, require

LARGEST_BYTES = 1_000_000
_LONGEST_LINE = 1 << 20
"""Bytes; ten times the longest line that a sweep writes."""
_FLAGS = ("O_NONBLOCK", "O_NOCTTY", "O_CLOEXEC", "O_BINARY")


@contextmanager
def opened(path: str | Path, kind: str) -> Iterator[BinaryIO]:
    """An ordinary file, or a link to one, to read from; nothing else is waited for.

    Args:
        kind: What the file should be, for the message: `sweep file`.

    Raises:
        InputError: There is no such file, it is no ordinary one, or it cannot be read, also while it is open.
    """
    try:
        _check_ordinary(path, kind, os.stat(path).st_mode)
        number = os.open(path, os.O_RDONLY | sum(getattr(os, flag, 0) for flag in _FLAGS))
        with os.fdopen(number, "rb") as file:
            _check_ordinary(path, kind, os.fstat(number).st_mode)
            yield file
    except OSError as error:
        raise InputError(f"{path}: the {kind} cannot be read ({error.strerror or error}); check the path.") from error
    except ValueError as error:
        if isinstance(error, InputError) or not _is_no_path(path):
            raise
        raise InputError(f"{str(path)!r}: this is not a path ({error}); give the path of a {kind}.") from error


def read_bytes(path: str | Path, kind: str, limit: int = LARGEST_BYTES, *, own: bool = False) -> bytes:
    """What stands in a file.

    Args:
        own: Whether it must belong to this user, where the system tells users apart.

    Raises:
        InputError: It is no ordinary file, cannot be opened, is larger than the limit, or belongs to another user.
    """
    with opened(path, kind) as file:
        require(
            not (own and hasattr(os, "geteuid") and os.fstat(file.fileno()).st_uid != os.geteuid()),
            f"{path}: the {kind} belongs to another user.",
        )
        content = file.read(limit + 1)
    require(len(content) <= limit, f"{path}: the file is larger than {limit / 1e6:g} MB; give a {kind}.")
    return content


def read_text(path: str | Path, kind: str, limit: int = LARGEST_BYTES, *, own: bool = False) -> str:
    """The text of a file, without a byte order mark.

    Args:
        own: As in `read_bytes`.

    Raises:
        InputError: It cannot be read, is larger than the limit, belongs to another user, or is not UTF-8.
    """
    return decoded(read_bytes(path, kind, limit, own=own), str(path), kind)


def each_line(path: str | Path, kind: str) -> Iterator[tuple[int, bytes]]:
    """The lines of a file, numbered from 1; a last one without an end, torn as it was written, is left out.

    Raises:
        InputError: It is no ordinary file, cannot be opened, or has a line longer than any that is written.
    """
    with opened(path, kind) as file:
        number = 0
        while line := file.readline(_LONGEST_LINE + 1):
            number += 1
            require(
                len(line) <= _LONGEST_LINE,
                f"{path}, line {number}: at most {_LONGEST_LINE:,} bytes are allowed in a line; remove it.",
            )
            if line.endswith(b"\n"):
                yield number, line


def decoded(raw: bytes, file: str, kind: str) -> str:
    """The text in bytes, without a byte order mark; `file` is their name in messages."""
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{file}: the file is not UTF-8 text (byte {error.start}); save the {kind} as UTF-8."
        ) from error


def _check_ordinary(path: str | Path, kind: str, mode: int) -> None:
    require(stat.S_ISREG(mode), f"{path}: {_kind(mode)} was given; give a {kind}.")


def _is_no_path(path: str | Path) -> bool:
    """Whether the system cannot even look for it: a zero byte in it, or half of a letter."""
    try:
        os.fsencode(path)
    except ValueError:
        return True
    return "\0" in str(path)


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
