"""One suite in a process of its own: `python -m benchmarks.corrector_bench.part SUITE DRAWS FILE`."""

from __future__ import annotations

import sys
import tempfile
from importlib import import_module
from pathlib import Path

from benchmarks.corrector_bench.rows import TrialRecord, read, written
from benchmarks.corrector_bench.runner import process


def part(suite: str, draws: int, limit_s: float) -> list[TrialRecord]:
    """The rows of one suite; if its process crashed or was killed, one row that says so."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "rows.json"
        arguments = ["-m", "benchmarks.corrector_bench.part", suite, str(draws), str(out)]
        ended, seconds = process(arguments, limit_s)
        if out.exists():
            return read(out)
        note = f"{ended}, after {seconds:.0f} s"
        return [TrialRecord(suite, "-", "the suite did not end", None, "<= 0", note)]


def main(suite: str, draws: str, out: str) -> None:
    module = import_module(f"benchmarks.corrector_bench.suite_{suite}")
    written(module.suite(int(draws)), Path(out), {})


if __name__ == "__main__":
    main(*sys.argv[1:])
