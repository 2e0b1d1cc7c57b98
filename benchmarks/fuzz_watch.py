"""What a command does beside what it says: files that it writes elsewhere, programs and code that it runs."""

from __future__ import annotations

import os
import stat
import sys
import tempfile
from collections.abc import Mapping, Sequence
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

WROTE = "a file was written elsewhere"
STARTED = "a program was started"
IMPORTED = "code in the current folder was run"
BESIDE = (WROTE, STARTED, IMPORTED)
_TRAP = f"import os\nos.write(2, b'{IMPORTED}\\n')\n"
TRAPS = ("sksparse", "pandas", "viser", "jax", "gtsam", "OCP", "numba_cuda", "pyceres", "pyarrow", "colorama", "tqdm")
"""Modules that a command or a library may look for, and that may not be installed."""
_STARTS = ("os.system", "os.exec", "os.posix_spawn", "socket.connect")
_CHANGES = {"os.mkdir": 1, "os.rename": 2, "os.remove": 1, "os.rmdir": 1, "os.truncate": 1, "os.chmod": 1}
"""Events and how many of their arguments are paths; of a link the second one is."""
_TO_WRITE = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_TEMPORARY = "temporary"


def lay_out(files: Mapping[str, bytes], place: Path, *, traps: bool = True) -> None:
    """Files of a case, a folder for what is temporary, a pipe that nobody writes, and modules that nobody may run."""
    place.mkdir(parents=True)
    for name, raw in files.items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_bytes(raw)
    (place / _TEMPORARY).mkdir()
    os.mkfifo(place / "fifo")
    for name in TRAPS if traps else ():
        (place / f"{name}.py").write_text(_TRAP, encoding="utf-8")


def watch(place: Path) -> None:
    """From here on name on stderr what this process does outside of a folder, and what it starts, until it ends."""
    inside = os.path.realpath(place)
    tempfile.tempdir = os.path.join(inside, _TEMPORARY)
    sys.dont_write_bytecode = True

    def hook(event: str, given: tuple[Any, ...]) -> None:
        if event in _STARTS or (event == "subprocess.Popen" and not _is_own(given[0])):
            os.write(2, f"{STARTED}: {event} {given[:2]!r}\n".encode())
            return
        if event == "open":
            paths = given[:1] if isinstance(given[2], int) and given[2] & _TO_WRITE else ()
        elif event in ("os.link", "os.symlink"):
            paths = given[1:2]
        else:
            paths = given[: _CHANGES.get(event, 0)]
        for path in paths:
            if isinstance(path, str | bytes | os.PathLike) and not _is_within(os.fsdecode(path), inside, event):
                os.write(2, f"{WROTE}: {event} {path!r}\n".encode())

    sys.addaudithook(hook)


def changed_files(place: Path, before: Mapping[str, bytes], writes: Sequence[str], special: Sequence[str] = ()) -> str:
    """What is wrong with the files that a case left behind; empty if nothing is.

    Args:
        before: Files that are read only, with what stood in them.
        writes: Patterns of the paths that the command was asked to write.
        special: What is no ordinary file.
    """
    for path in sorted(place.rglob("*")):
        name = path.relative_to(place).as_posix()
        mode = path.lstat().st_mode
        asked = any(fnmatch(name, pattern) for pattern in writes)
        if name in before and not asked and (not stat.S_ISREG(mode) or path.read_bytes() != before[name]):
            return f"{WROTE}: {name} is not what it was"
        known = name in before or name in ("fifo", _TEMPORARY, *special) or name.removesuffix(".py") in TRAPS
        if not (known or asked or stat.S_ISDIR(mode)):
            return f"{WROTE}: {name}"
    return next((f"{WROTE}: {name} is gone" for name in before if not (place / name).exists()), "")


def _is_own(program: Any) -> bool:
    """Whether a program is this Python, or asks what the machine is."""
    return os.fsdecode(program) == sys.executable or os.path.basename(os.fsdecode(program)) in ("uname", "ldconfig")


def _is_within(path: str, folder: str, event: str) -> bool:
    """Whether what an event changes lies in a folder, or is compiled code beside its source."""
    if event == "open":
        real = os.path.realpath(path)
    else:  # of a link itself
        real = os.path.join(os.path.realpath(os.path.dirname(path) or "."), os.path.basename(path))
    return real == os.devnull or real.startswith(folder + os.sep) or real == folder or "__pycache__" in real
