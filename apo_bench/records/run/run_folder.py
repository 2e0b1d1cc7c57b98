"""Write and read the folder of a sweep, to which records are appended.

trials.jsonl   one record per trial: only what settings and seed determine
timing.jsonl   one line per trial: wall times, host, worker; missing lines do not matter
run.json       grids, inputs, versions, command line, git revision
torn.txt       incomplete lines of an interrupted sweep, if any
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
from apo_bench.records.run.validation import decode_record, describe_unwritable
from apo_bench.records.secret_seed import check_same_secret_seed

CHUNK = 1 << 16  # bytes that are read at a time
TRIALS_KIND = "table of trials"  # in messages


@final
class RunFolder:
    """Context manager that appends records to the folder of a sweep, and keeps other writers out."""

    def __init__(self, folder: Path, run: Mapping[str, Any]) -> None:
        """Open a folder, which is made if it does not exist.

        Raises:
            InputError: The folder cannot be written, another process writes to it, or it holds trials of another sweep.
        """
        self.folder = folder
        self.finished: dict[Key, str] = {}
        """Key of each trial that has a record -> its `compute_config_hash`."""
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with ExitStack() as opened:
                self._trials = opened.enter_context(open_to_append(folder / "trials.jsonl"))
                _lock_file(self._trials.fileno(), folder)
                for name in ("trials.jsonl", "timing.jsonl"):
                    _set_torn_line_aside(folder / name)
                for record in iterate_records(folder):
                    check_same_secret_seed(f"'{folder}'", run.get("secret_seed"), record["secret_seed"])
                    self.finished[get_record_key(record)] = record["config_hash"]
                if self.finished:
                    check_same(folder, run)
                write_run(folder, run)
                self._timing = opened.enter_context(open_to_append(folder / "timing.jsonl"))
                self._files = opened.pop_all()  # closed by __exit__
        except OSError as error:
            raise InputError(
                f"the folder '{folder}' cannot be written ({error.strerror}); choose another one with --out."
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._files.close()

    def append(self, record: Mapping[str, Any], timing: Mapping[str, Any]) -> None:
        """Append record and timing of a finished trial.

        Raises:
            RuntimeError: The record is invalid, or cannot be written, as on a full disk; no part of it stays in the
            file.
        """
        kept = f"the {len(self.finished)} before it are kept"
        wrong = describe_unwritable(record)
        if wrong:
            raise RuntimeError(f"a record is not valid ({wrong}); {kept} in {self.folder}.")
        try:
            _append_line(self._trials.fileno(), record)
        except OSError as error:
            raise RuntimeError(
                f"a record could not be written to {self.folder / 'trials.jsonl'} ({error.strerror}); {kept}, and the "
                "same command continues once there is room."
            ) from error
        self.finished[get_record_key(record)] = record["config_hash"]
        with suppress(OSError):  # a missing timing does not matter
            _append_line(self._timing.fileno(), timing)


def read_records(folder: str | Path) -> list[TrialRecord]:
    """Read the records of a sweep, in the order in which the trials ended, without an incomplete last line.

    Raises:
        InputError: There is no such folder, it holds no trials, or a line is no record.
    """
    return list(iterate_records(folder))


def iterate_records(folder: str | Path) -> Iterator[TrialRecord]:
    """Yield the records of a folder one by one, so that a reader need not hold all of them."""
    path = find_trials(folder)
    yield from (decode_record(line, f"{path}, line {number}") for number, line in read_lines(path, TRIALS_KIND))


def find_trials(folder: str | Path) -> Path:
    """Return the file of the records of a folder.

    Raises:
        InputError: There is no such file.
    """
    path = Path(folder) / "trials.jsonl"
    require(
        path.exists(),
        f"the folder '{folder}' holds no sweep (no {path.name}); give the one that `apo-bench sweep --out` wrote.",
    )
    return path


def _lock_file(file: int, folder: Path) -> None:
    """Lock a file against other writers until it is closed or the process ends."""
    try:
        import fcntl
    except ImportError:
        return  # Windows has no flock
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise InputError(
            f"another sweep is writing to '{folder}'; wait until it has ended, or choose another folder."
        ) from error
    except OSError:
        return  # some network file systems cannot lock


def _append_line(file: int, line: Mapping[str, Any]) -> None:
    """Append a line; if that fails, remove the part that was written."""
    left = json.dumps(line, allow_nan=False).encode() + b"\n"
    before = os.fstat(file).st_size
    try:
        while left:
            left = left[os.write(file, left) :]  # os.write may write a part only
    except OSError:
        with suppress(OSError):
            os.ftruncate(file, before)
        raise


def _set_torn_line_aside(path: Path) -> None:
    """Move an incomplete last line of an interrupted sweep to the file `torn.txt`."""
    check_target(path)
    if not path.exists():
        return
    with path.open("rb+") as file:
        end = file.seek(0, os.SEEK_END)
        at = end
        tail = b""
        while at > 0 and b"\n" not in tail:  # read backwards until the last end of a line
            at = max(0, at - CHUNK)
            file.seek(at)
            tail = file.read(end - at)
        torn = tail[tail.rfind(b"\n") + 1 :]
        if torn:
            with open_to_append(path.parent / "torn.txt") as aside:
                aside.write(torn + b"\n")
            file.truncate(end - len(torn))
