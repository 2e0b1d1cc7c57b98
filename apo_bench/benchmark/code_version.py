"""The code that shapes a row, file by file: every source file of the package but those that are named here."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from types import MappingProxyType

AFTERWARDS = """
    adjust alone area bounded calibration compare confusion crew crew_member crew_process csv_file curve effort eye_one
    failure_pictures falling half_level journal kept_file mcnemar misgivings on_ray one own_code paired parcel parquet
    plan_lines power progress ray_crew ray_driver ray_hand replay_command report run_file slim statistics stopping
    summary sweep sweep_file terminal
"""
LEFT_OUT = (
    *("cli*.py", "arguments.py", "output.py", "benchmark/page/*", "benchmark/figure*.py", "benchmark/graph_*.py"),
    *("benchmark/*_picture.py", "benchmark/*_table.py", "benchmark/*_text.py", "benchmark/*card.py"),
    *(f"benchmark/{name}.py" for name in AFTERWARDS.split()),
)
"""What no trial runs through: commands, how work is spread and written, and all that is made of rows afterwards."""


@cache
def code_files() -> Mapping[str, str]:
    """Source file, relative to the package -> 16 hexadecimal digits over its lines; read once per process."""
    found = sources(files("apo_bench"))
    return MappingProxyType({path: _hash(text) for path, text in sorted(found) if counts(path)})


def counts(path: str) -> bool:
    """Whether a source file of the package shapes rows."""
    return not any(fnmatchcase(path, pattern) for pattern in LEFT_OUT)


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
