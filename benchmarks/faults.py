"""Whether the tests notice small errors in the code: fifty of them, one at a time, each in a copy of its own.

    python -m benchmarks.faults [--only ROOM ...] [--fault N ...] [--workers 1] [--write [FILE]]

Every copy has one error out of `fault_list.py`, and the tests of its room are run in it, up to the first that fails:
those of `tests/ROOM` that `make test` runs, one after the other. In a copy without an error they must all pass, so
every room is run once as it is. What was noticed, by which test and after how long, is printed; `--write` writes it, to
`results/faults.json`, in the place of what is kept there of the same errors and rooms. Ends with exit code 1 if an
error is not noticed, and if one cannot be made any more, as its text is not in its file exactly once. The checkout
itself is never changed. Some tests look for processes that they started, so rooms are run together (`--workers`) only
to look for errors that nobody notices.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.fault_list import FAULTS, Fault

ROOT = Path(__file__).parents[1]
RESULT = ROOT / "benchmarks" / "results" / "faults.json"
LONGEST_S = 900
"""Tests that have not ended by then have noticed nothing."""


class Ran(NamedTuple):
    """What came of the tests of a room."""

    passed: bool
    by: str
    """The test that failed first; how they ended where none did."""
    seconds: float


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--only", nargs="+", metavar="ROOM")
    parser.add_argument("--fault", nargs="+", type=int, metavar="N", help="counted from 1")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--write", type=Path, nargs="?", const=RESULT)
    asked = parser.parse_args()
    chosen = [
        (number, fault)
        for number, fault in enumerate(FAULTS, start=1)
        if (not asked.only or fault.room in asked.only) and (not asked.fault or number in asked.fault)
    ]
    lost = [
        number for number, fault in chosen if (ROOT / "apo_bench" / fault.file).read_text().count(fault.before) != 1
    ]
    for number in lost:
        print(f"{number}: {FAULTS[number - 1].before!r} is not in {FAULTS[number - 1].file} exactly once")
    if lost:
        return 1
    rooms = list(dict.fromkeys(fault.room for _, fault in chosen))
    jobs: list[Fault | str] = [*rooms, *(fault for _, fault in chosen)]
    with tempfile.TemporaryDirectory() as work, ThreadPoolExecutor(asked.workers) as pool:
        ran = list(pool.map(lambda job: run(ROOT, job, Path(work) / threading.current_thread().name), jobs))
    sound = dict(zip(rooms, ran, strict=False))
    found = list(zip(chosen, ran[len(rooms) :], strict=True))
    for room, whole in sound.items():
        print(f"   {room:12} without an error: {whole.by}, {whole.seconds:.0f} s")
    for (number, fault), one in found:
        how = "NOT NOTICED" if one.passed else f"noticed after {one.seconds:.0f} s by {one.by}"
        print(f"{number:2} {fault.file}: {fault.what}: {how}")
    if asked.write:
        kept = json.loads(asked.write.read_text(encoding="utf-8")) if asked.write.exists() else {}
        asked.write.write_text(json.dumps(summary(sound, found, kept), indent=1) + "\n", encoding="utf-8")
    return int(any(one.passed for _, one in found) or not all(whole.passed for whole in sound.values()))


def run(root: Path, job: Fault | str, work: Path) -> Ran:
    """Run the tests of a room in a copy, with an error, or without one where only the room is named.

    Args:
        work: A folder for copies, one after the other at one place, so that Numba compiles again only what differs.

    Raises:
        RuntimeError: The tests could not be run.
    """
    place = work / "copy"
    shutil.rmtree(place, ignore_errors=True)
    copy(root, place)
    if isinstance(job, Fault):
        put(job, place)
    return tested(place, job.room if isinstance(job, Fault) else job, LONGEST_S)


def copy(root: Path, place: Path) -> None:
    """All files that git knows, and new ones that it does not ignore."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"]
    said = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True).stdout
    for name in filter(None, said.split("\0")):
        if (root / name).is_file():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(root / name, place / name)


def is_possible(fault: Fault, place: Path) -> bool:
    """Whether the text of the error is in its file exactly once."""
    return (place / "apo_bench" / fault.file).read_text(encoding="utf-8").count(fault.before) == 1


def put(fault: Fault, place: Path) -> None:
    """Make the error in a copy.

    Raises:
        RuntimeError: Its text is not there exactly once.
    """
    if not is_possible(fault, place):
        raise RuntimeError(f"{fault.before!r} is not in {fault.file} exactly once")
    path = place / "apo_bench" / fault.file
    path.write_text(path.read_text(encoding="utf-8").replace(fault.before, fault.after), encoding="utf-8")


def tested(place: Path, room: str, longest_s: float) -> Ran:
    """The tests of a room in a copy, up to the first that fails; what hypothesis draws is the same every time."""
    options = ["-q", "-x", "-n", "0", "-m", "not extras", "--tb=no", "-rfE", "--hypothesis-seed=0"]
    command = [sys.executable, "-m", "pytest", *options, f"tests/{room}"]
    env = os.environ | {"PYTHONPATH": str(place), "NUMBA_CACHE_DIR": str(place.parent / "compiled")}
    env |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    began = time.perf_counter()
    try:
        ended = subprocess.run(
            command, cwd=place, env=env, capture_output=True, text=True, timeout=longest_s, check=False
        )
    except subprocess.TimeoutExpired:
        return Ran(True, f"no end within {longest_s:g} s", longest_s)
    seconds = round(time.perf_counter() - began, 1)
    if ended.returncode not in (0, 1):
        raise RuntimeError(
            f"the tests of {room} ended with exit code {ended.returncode}:\n{ended.stdout}{ended.stderr}"
        )
    by = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", ended.stdout, re.MULTILINE)
    return Ran(not ended.returncode, by[1] if by else ended.stdout.splitlines()[-1], seconds)


def provenance(root: Path) -> dict[str, str]:
    """The command that runs, and the commit of the checkout that it tries."""
    head = subprocess.run(["git", "rev-parse", "HEAD"], cwd=root, capture_output=True, text=True, check=False)
    return {
        "command": "python -m benchmarks." + " ".join([Path(sys.argv[0]).stem, *sys.argv[1:]]),
        "commit": head.stdout.strip(),
    }


def summary(
    sound: Mapping[str, Ran], found: Sequence[tuple[tuple[int, Fault], Ran]], kept: Mapping[str, Any]
) -> dict[str, Any]:
    """What is written: errors and rooms that were run now, and of those that were not what was kept."""
    made = provenance(ROOT)
    errors = {error["number"]: error for error in kept.get("faults", ())} | {
        number: {"number": number, **fault._asdict(), "noticed": not one.passed, "by": one.by, "seconds": one.seconds}
        | made
        for (number, fault), one in found
    }
    rooms = {
        room: {"passed": one.passed, "tests": one.by, "seconds": one.seconds} | made for room, one in sound.items()
    }
    return {
        "python": platform.python_version(),
        "noticed": sum(error["noticed"] for error in errors.values()),
        "faults": [errors[number] for number in sorted(errors)],
        "without_an_error": {**kept.get("without_an_error", {}), **rooms},
    }


if __name__ == "__main__":
    sys.exit(main())
