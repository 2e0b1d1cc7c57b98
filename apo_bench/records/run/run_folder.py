"""The folder of a sweep, to which records are appended.

trials.jsonl   one record per trial: only what settings and seed determine
timing.jsonl   one line per trial: wall times, host, worker; missing lines do not matter
run.json       grids, inputs, versions, command line, git revision
torn.txt       half lines of an interrupted sweep, if any
"""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, Self, final

from apo_bench.errors import InputError, require
from apo_bench.io import check_target, open_to_append, read_lines
from apo_bench.records.record import Key, TrialRecord, get_record_key
from apo_bench.records.run.run_file import check_same, write_run
from apo_bench.records.run.validation import record_of, unwritable
from apo_bench.records.secret_seed import check_same_secret_seed

CHUNK = 1 << 16


@final
class RunFolder:
    """Append records to the folder of a sweep and keep other writers out; a context manager."""

    def __init__(self, folder: Path, run: Mapping[str, Any]) -> None:
        """Open a folder, which is made if it does not exist.

        Raises:
            InputError: The folder cannot be written, is being written, or holds trials of another sweep.
        """
        self.folder = folder
        self.finished: dict[Key, str] = {}
        """Key of each trial that has a record -> its `config_hash`."""
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with ExitStack() as opened:
                self._trials = opened.enter_context(open_to_append(folder / "trials.jsonl"))
                _lock(self._trials.fileno(), folder)
                for name in ("trials.jsonl", "timing.jsonl"):
                    _set_torn_line_aside(folder / name)
                for record in each_record(folder):
                    check_same_secret_seed(f"'{folder}'", run.get("secret_seed"), record["secret_seed"])
                    self.finished[get_record_key(record)] = record["config_hash"]
                if self.finished:
                    check_same(folder, run)
                write_run(folder, run)
                self._timing = opened.enter_context(open_to_append(folder / "timing.jsonl"))
                self._files = opened.pop_all()
        except OSError as error:
            raise InputError(
                f"the folder '{folder}' cannot be written ({error.strerror}); choose another one with --out."
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._files.close()

    def append(self, record: Mapping[str, Any], timing: Mapping[str, Any]) -> None:
        """Add a trial that has ended, each line in one write.

        Raises:
            RuntimeError: The record does not fit the table of fields, or cannot be written, as on a full disk; then
                the half line is removed.
        """
        kept = f"the {len(self.finished)} before it are kept"
        wrong = unwritable(record)
        if wrong:
            raise RuntimeError(f"a record is not valid ({wrong}); {kept} in {self.folder}.")
        try:
            _append(self._trials.fileno(), record)
        except OSError as error:
            raise RuntimeError(
                f"a record could not be written to {self.folder / 'trials.jsonl'} ({error.strerror}); {kept}, and the "
                "same command continues once there is room."
            ) from error
        self.finished[get_record_key(record)] = record["config_hash"]
        with suppress(OSError):
            _append(self._timing.fileno(), timing)


def read_records(folder: str | Path) -> list[TrialRecord]:
    """The records of a sweep, in the order in which the trials ended, without a torn last line.

    Raises:
        InputError: No such folder, no trials in it, or a line that is not a record.
    """
    return list(each_record(folder))


def each_record(folder: str | Path) -> Iterator[TrialRecord]:
    """The records of a folder one after the other, so that a reader need not hold them all."""
    path = Path(folder) / "trials.jsonl"
    require(
        path.exists(),
        f"the folder '{folder}' holds no sweep (no {path.name}); give the one that `apo-bench sweep --out` wrote.",
    )
    yield from (record_of(line, f"{path}, line {number}") for number, line in read_lines(path, "table of trials"))


def _lock(file: int, folder: Path) -> None:
    """Keep other writers out until the file is closed or the process ends."""
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
    """Add a whole line, or nothing."""
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
    """Move what follows the last end of a line, which is no record, into another file."""
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
