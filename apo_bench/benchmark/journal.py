"""The folder of a sweep: rows that are only ever appended, whole, and what the sweep was asked to do.

trials.jsonl   one row per trial; nothing but what specification and seed determine
timing.jsonl   one line per trial: wall times, host, worker
run.json       specification, versions, command line
torn.txt       half lines that an interrupted sweep left behind, if any
"""

from __future__ import annotations

import json
import platform
from collections.abc import Iterator, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any, BinaryIO, final

from apo_bench.benchmark.confidence import UNKNOWN
from apo_bench.benchmark.grid import Key, row_key
from apo_bench.benchmark.recognised import UNCOUNTED
from apo_bench.benchmark.spec import ROW
from apo_bench.errors import InputError

RUN = "apo-bench/run/2"
OLD_ROWS = ("apo-bench/row/2", "apo-bench/row/3", "apo-bench/row/4")
"""Rows that say less: nothing about the test of a correction and its posterior, the eye, the fidelity. Reports still
read them."""
UNSAID = {**UNKNOWN, **UNCOUNTED, "eye": "noise", "fidelity": "full"}
"""What stands in place of what older rows do not say."""
PACKAGES = (
    *("apo_bench", "mujoco", "dm-control", "mink", "daqp", "gymnasium"),
    *("numpy", "scipy", "trimesh", "manifold3d", "shapely"),
)


def run_record(specification: Mapping[str, Any], content: Mapping[str, str], command: str) -> dict[str, Any]:
    """What `run.json` says.

    Args:
        content: Scenario name -> `content_hash`.
    """
    return {
        "schema": RUN,
        "specification": dict(specification),
        "content": dict(content),
        "versions": {package: metadata.version(package) for package in PACKAGES},
        "python": platform.python_version(),
        "platform": platform.platform(),
        "command": command,
    }


@final
class Journal:
    """Appends rows to the folder of a sweep; a context manager."""

    def __init__(self, folder: Path, run: Mapping[str, Any]) -> None:
        """Open a folder, made if it is not there.

        Raises:
            InputError: The folder cannot be written, or holds trials of another sweep.
        """
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
            for name in ("trials.jsonl", "timing.jsonl"):
                _set_torn_line_aside(folder / name)
            self.rows = read_rows(folder) if (folder / "trials.jsonl").exists() else []
            if self.rows:
                _check_same(folder, run)
            (folder / "run.json").write_text(json.dumps(run, indent=2) + "\n", encoding="utf-8")
            self._trials: BinaryIO = (folder / "trials.jsonl").open("ab")
            self._timing: BinaryIO = (folder / "timing.jsonl").open("ab")
        except OSError as error:
            raise InputError(
                f"the folder '{folder}' cannot be written ({error.strerror}); choose another one with --out."
            ) from error

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, *_: object) -> None:
        self._trials.close()
        self._timing.close()

    @property
    def finished(self) -> frozenset[Key]:
        """The trials that have a row."""
        return frozenset(row_key(row) for row in self.rows)

    def append(self, row: Mapping[str, Any], timing: Mapping[str, Any]) -> None:
        """Add a trial that has ended: each line in one write, then flushed."""
        self.rows.append(dict(row))
        for file, line in ((self._trials, row), (self._timing, timing)):
            file.write(json.dumps(line, allow_nan=False).encode() + b"\n")
            file.flush()


def read_rows(folder: str | Path) -> list[dict[str, Any]]:
    """The rows of a sweep, in the order in which they ended; a torn last line is left out.

    Raises:
        InputError: No such folder, no trials in it, or a line that is not a row.
    """
    return list(each_row(folder))


def each_row(folder: str | Path) -> Iterator[dict[str, Any]]:
    """The same, one after the other, so that a reader need not hold them all."""
    path = Path(folder) / "trials.jsonl"
    try:
        with path.open("rb") as file:
            for i, line in enumerate(file, start=1):
                if line.endswith(b"\n"):
                    yield _row(line, path, i)
    except OSError as error:
        raise InputError(
            f"the folder '{folder}' holds no sweep ({error.strerror}: {path.name}); give the one that "
            "`apo-bench sweep --out` wrote."
        ) from error


def _row(line: bytes, path: Path, number: int) -> dict[str, Any]:
    try:
        row = json.loads(line)
        row_key(row)
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{path}, line {number}: this is not a row of a sweep; remove the line or the folder."
        ) from error
    if row.get("schema") in OLD_ROWS:
        return {**UNSAID, **row}
    if row.get("schema") != ROW:
        raise InputError(f"{path}, line {number}: a row of schema '{row.get('schema')}' was given; '{ROW}' is needed.")
    return row


def _set_torn_line_aside(path: Path) -> None:
    if not path.exists():
        return
    text = path.read_bytes()
    whole = text.rfind(b"\n") + 1
    if whole == len(text):
        return
    with (path.parent / "torn.txt").open("ab") as torn:
        torn.write(text[whole:] + b"\n")
    with path.open("rb+") as file:
        file.truncate(whole)


def _check_same(folder: Path, run: Mapping[str, Any]) -> None:
    path = folder / "run.json"
    try:
        before = json.loads(path.read_text(encoding="utf-8"))
        specification = before["specification"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"'{folder}' has trials but no readable run.json; choose another folder.") from error
    now = json.loads(json.dumps(run))
    for key in ("content", "versions"):
        _refuse_other(folder, before.get(key), now[key], key)
    _refuse_other(folder, specification, now["specification"], "specification")


def _refuse_other(folder: Path, before: Any, now: Any, what: str) -> None:
    """More trials of the same sweep are welcome; anything else that differs is another sweep."""
    before = before if isinstance(before, dict) else {}
    for key in sorted({*before, *now}):
        old, new = before.get(key), now.get(key)
        grown = (what, key) == ("specification", "trials") and isinstance(old, int) and new >= old
        if old != new and not grown:
            raise InputError(
                f"'{folder}' holds trials of another sweep ({what}: {key} was {json.dumps(old)}, "
                f"now {json.dumps(new)}); choose another folder."
            )
