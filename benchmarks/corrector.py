"""The corrector against its targets and against other solvers: `python benchmarks/corrector.py` (ten minutes).

Prints a table of targets, what was measured and whether it was met, and writes every number as JSON. Draws are
synthetic and Gaussian around an exactly consistent truth; each peer runs in a process of its own with a time limit.
GTSAM, pyceres and Numba are measured if they are installed. The page
`docs/results/corrector.md` is written too. Suites that `--only` leaves out stay as they were, with their commit.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path
from typing import Any

sys.path.pop(0)  # this folder, whose coverage.py Numba takes for another
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from benchmarks.corrector_bench import suite_door, suite_quality
from benchmarks.corrector_bench.page import page
from benchmarks.corrector_bench.part import part
from benchmarks.corrector_bench.rows import TrialRecord, printed, records, save

OUT = Path(__file__).resolve().parent / "results" / "corrector.json"
PAGE = Path(__file__).resolve().parents[1] / "docs" / "results" / "corrector.md"
APART = {
    "freedom": 300.0,
    "edges": 300.0,
    "walls": 600.0,
    "compiled": 300.0,
    "scale": 300.0,
    "wrong": 600.0,
    "calibration": 900.0,
}
"""Suites that run in one process each, and their limits in seconds."""
SUITES = ("door", "quality", *APART)
PACKAGES = ("apo_bench", "numpy", "scipy", "daqp", "numba", "gtsam", "pyceres")


def main() -> int:
    given = _arguments()
    commit = _commit()
    rows = list[TrialRecord]()
    suites = _kept(given.out)
    for suite in given.only:
        start = time.monotonic()
        found = _measured(suite, given.draws)
        seconds = round(time.monotonic() - start, 1)
        print(f"\n{suite} ({seconds:.0f} s)\n{printed(found)}", flush=True)
        rows += found
        suites[suite] = {"commit": commit, "draws": given.draws, "seconds": seconds, "rows": records(found)}
        document = {**_machine(), "suites": {name: suites[name] for name in SUITES if name in suites}}
        save(document, given.out)
        if given.out == OUT:
            PAGE.write_text(page(document), encoding="utf-8")
    missed = [row for row in rows if row.met is False]
    judged = sum(row.met is not None for row in rows)
    print(f"\n{judged - len(missed)} of {judged} targets met; every number is in {given.out}")
    if missed:
        print(printed(missed))
    return 0


def _kept(path: Path) -> dict[str, Any]:
    """Suites of an earlier run, which stay as they are unless they are run again; each names its commit."""
    return dict(json.loads(path.read_text(encoding="utf-8")).get("suites", {})) if path.is_file() else {}


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=200, help="draws per figure; other counts scale with it (200)")
    parser.add_argument("--only", nargs="+", choices=SUITES, default=list(SUITES), help="suites to run (all)")
    parser.add_argument("--out", type=Path, default=OUT, help="JSON file to write")
    return parser.parse_args()


def _measured(suite: str, draws: int) -> list[TrialRecord]:
    if suite == "quality":
        return suite_quality.suite(draws)
    if suite == "door":
        return suite_door.suite(draws)
    return part(suite, draws, APART[suite])


def _machine() -> dict[str, object]:
    versions = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = "not installed"
    return {"versions": versions, "machine": f"{platform.machine()}, {os.cpu_count()} cores"}


def _commit() -> str:
    asked = ["git", "describe", "--always", "--dirty"]
    return subprocess.run(asked, cwd=OUT.parent, capture_output=True, text=True).stdout.strip() or "unknown"


if __name__ == "__main__":
    sys.exit(main())
