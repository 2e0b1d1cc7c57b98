"""The code that shapes a row, file by file: every source file of the package but those of the rooms named here."""

import hashlib
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from types import MappingProxyType

LEFT_OUT = ("cli", "drafting", "envs", "report", "show", "statistics", "sweeps/local", "sweeps/ray")
"""Rooms that no trial runs through: commands, how work is spread, and all that is made of rows afterwards."""


@cache
def code_files() -> Mapping[str, str]:
    """Source file, relative to the package -> 16 hexadecimal digits over its lines; read once per process."""
    found = sources(files("apo_bench"))
    return MappingProxyType({path: _hash(text) for path, text in sorted(found) if counts(path)})


def counts(path: str) -> bool:
    """Whether a source file of the package shapes rows."""
    return not path.startswith(tuple(f"{room}/" for room in LEFT_OUT))


def sources(package: Traversable, prefix: str = "") -> Iterator[tuple[str, bytes]]:
    """Every Python file of a package and what stands in it, wherever it is installed."""
    for entry in package.iterdir():
        if entry.is_dir() and entry.name != "__pycache__":
            yield from sources(entry, f"{prefix}{entry.name}/")
        elif entry.name.endswith(".py"):
            yield prefix + entry.name, entry.read_bytes()


def _hash(text: bytes) -> str:
    """Ends of lines do not count: they are the version control's."""
    return hashlib.sha256(text.replace(b"\r\n", b"\n")).hexdigest()[:16]
