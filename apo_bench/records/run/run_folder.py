"""The folder of a sweep: rows that are only ever appended, whole, and what the sweep was asked to do.

trials.jsonl   one row per trial; nothing but what specification and seed determine
timing.jsonl   one line per trial: wall times, host, worker; lines that are missing do not matter
run.json       grids, code, content, versions, command line
torn.txt       half lines that an interrupted sweep left behind, if any
"""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, Self, final

from apo_bench.errors import InputError, require
from apo_bench.io import check_target, each_line, open_to_append
from apo_bench.records.record import Key, TrialRecord, record_key
from apo_bench.records.run.run_file import check_same, write_run
from apo_bench.records.run.validation import row_of, unwritable
from apo_bench.records.secret_seed import check_same_secret_seed

CHUNK = 1 << 16


@final
class RunFolder:
    """Appends rows to the folder of a sweep, and lets nobody else do so meanwhile; a context manager."""

    def __init__(self, folder: Path, run: Mapping[str, Any]) -> None:
        """Open a folder, made if it is not there.

        Raises:
            InputError: The folder cannot be written, is being written, or holds trials of another sweep.
        """
        self.folder = folder
        self.finished: dict[Key, str] = {}
        """The trials that have a row, and its `config_hash`."""
        try:
            self._place = folder.absolute()
            folder.mkdir(parents=True, exist_ok=True)
            self._trials: IO[bytes] = open_to_append(folder / "trials.jsonl")
            try:
                _lock(self._trials.fileno(), folder)
                for name in ("trials.jsonl", "timing.jsonl"):
                    _set_torn_line_aside(folder / name)
                self._read(run)
                write_run(folder, run)
                self._timing: IO[bytes] = open_to_append(folder / "timing.jsonl")
            except BaseException:
                self._trials.close()
                raise
        except OSError as error:
            raise InputError(
                f"the folder '{folder}' cannot be written ({error.strerror}); choose another one with --out."
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._trials.close()
        self._timing.close()

    def append(self, row: Mapping[str, Any], timing: Mapping[str, Any]) -> None:
        """Add a trial that has ended, each line in one write.

        Raises:
            RuntimeError: The row could not be written, such as on a full disk; what was written of it is taken back.
                Or it is none by the table of fields, so that nobody could read it again.
        """
        wrong = unwritable(row)
        if wrong:
            raise RuntimeError(
                f"a row was made that is none ({wrong}); the {len(self.finished)} before it are kept in {self.folder}."
            )
        try:
            _append(self._trials.fileno(), row)
        except OSError as error:
            raise RuntimeError(
                f"a row could not be written to {self.folder / 'trials.jsonl'} ({error.strerror}); the "
                f"{len(self.finished)} before it are kept, and the same command continues once there is room."
            ) from error
        self.finished[record_key(row)] = row["config_hash"]
        with suppress(OSError):
            _append(self._timing.fileno(), timing)

    def rows(self) -> list[TrialRecord]:
        """All rows of the folder."""
        return read_rows(self._place)

    def _read(self, run: Mapping[str, Any]) -> None:
        for row in each_row(self.folder):
            check_same_secret_seed(f"'{self.folder}'", run.get("secret_seed"), row["secret_seed"])
            self.finished[record_key(row)] = row["config_hash"]
        if self.finished:
            check_same(self.folder, run)


def read_rows(folder: str | Path) -> list[TrialRecord]:
    """The rows of a sweep, in the order in which they ended; a torn last line is left out.

    Raises:
        InputError: No such folder, no trials in it, or a line that is not a row.
    """
    return list(each_row(folder))


def each_row(folder: str | Path) -> Iterator[TrialRecord]:
    """The rows of a folder one after the other, so that a reader need not hold them all."""
    path = Path(folder) / "trials.jsonl"
    require(
        path.exists(),
        f"the folder '{folder}' holds no sweep (no {path.name}); give the one that `apo-bench sweep --out` wrote.",
    )
    yield from (row_of(line, f"{path}, line {number}") for number, line in each_line(path, "table of trials"))


def _lock(file: int, folder: Path) -> None:
    """Nobody else may write until the file is closed or the process ends, in whatever way."""
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise InputError(
            f"another sweep is writing to '{folder}'; wait until it has ended, or choose another folder."
        ) from error
    except OSError:
        return


def _append(file: int, line: Mapping[str, Any]) -> None:
    """Add a line whole, or not at all."""
    left = json.dumps(line, allow_nan=False).encode() + b"\n"
    before = os.fstat(file).st_size
    try:
        while left:
            left = left[os.write(file, left) :]
    except OSError:
        with suppress(OSError):
            os.ftruncate(file, before)
        raise


def _set_torn_line_aside(path: Path) -> None:
    """What follows the last end of a line is no row: a copy of it is kept, and it goes."""
    check_target(path)
    if not path.exists():
        return
    with path.open("rb+") as file:
        end = file.seek(0, os.SEEK_END)
        at = end
        tail = b""
        while at > 0 and b"\n" not in tail:
            at = max(0, at - CHUNK)
            file.seek(at)
            tail = file.read(end - at)
        torn = tail[tail.rfind(b"\n") + 1 :]
        if torn:
            with open_to_append(path.parent / "torn.txt") as aside:
                aside.write(torn + b"\n")
            file.truncate(end - len(torn))
