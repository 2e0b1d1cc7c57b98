"""Whether a sweep survives `kill -9`: killed at random moments, again and again, then completed and compared.

    python benchmarks/killing.py [KILLS=20] [SEED=0]

First the sweep runs undisturbed. Then it is started in another folder and killed, the process that writes alone or with
its workers, `KILLS` times: a moment drawn from `SEED` after a row was added, or after the start. After every kill each
whole line must be a row of the first folder, and none that was there before may be gone. At last it runs to its end,
with another number of workers: the sorted lines must be the same, byte for byte.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

GRID = ["stick_in_tower", "stick_on_castles", "--levels", "0.5,2", "--careless", "0,1"]
METHODS = ["--methods", "none,paper,contact", "--trials", "3"]
LATEST_S = 3.0
"""Some trials long."""
FROM_THE_START = 0.2
"""How often it is killed before it has added a row."""


def main(kills: int, seed: int) -> int:
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder) / "whole"
        part = Path(folder) / "part"
        began = time.perf_counter()
        subprocess.run(command(whole, 2), check=True, capture_output=True)
        wanted = lines(whole)
        print(f"undisturbed: {len(wanted)} rows in {time.perf_counter() - began:.0f} s", flush=True)
        before: list[bytes] = []
        for kill in range(1, kills + 1):
            workers = 1 + kill % 3
            after_s = float(rng.uniform(0.0, LATEST_S))
            group = bool(rng.integers(2))
            goal = len(before) + (rng.random() > FROM_THE_START)
            done = killed(command(part, workers), part, goal, after_s, group)
            now = lines(part)
            assert set(now) <= set(wanted), "a wrong row"
            assert now[: len(before)] == before, "a finished row was lost"
            how = "ended before it" if done else "with its workers" if group else "alone"
            when = f"{after_s:.2f} s after {'a row' if goal > len(before) else 'its start'}"
            print(f"kill {kill:2d}, {when}, {workers} workers, {how}: {len(now)} rows", flush=True)
            before = now
        subprocess.run(command(part, 4), check=True, capture_output=True)
        same = sorted(lines(part)) == sorted(wanted)
        torn = (part / "torn.txt").read_bytes().count(b"\n") if (part / "torn.txt").exists() else 0
        print(f"completed: {len(lines(part))} rows, {torn} torn lines set aside, the same as undisturbed: {same}")
        return 0 if same else 1


def command(out: Path, workers: int) -> list[str]:
    sweep = [sys.executable, "-m", "apo_bench.cli.app", "sweep", *GRID, *METHODS]
    return [*sweep, "--workers", str(workers), "--out", str(out)]


def killed(asked: list[str], folder: Path, goal: int, after_s: float, group: bool) -> bool:
    """Start a sweep and kill it some time after there are `goal` rows; True if it had ended by itself."""
    process = subprocess.Popen(asked, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    while len(lines(folder)) < goal and process.poll() is None:
        time.sleep(0.02)
    try:
        process.wait(after_s)
    except subprocess.TimeoutExpired:
        for pid in [process.pid, *(children(process.pid) if group else [])]:
            os.kill(pid, signal.SIGKILL)
        process.wait()
        return False
    assert process.returncode == 0, process.stderr.read() if process.stderr else ""
    return True


def children(pid: int) -> list[int]:
    return [
        int(child) for task in Path(f"/proc/{pid}/task").iterdir() for child in (task / "children").read_text().split()
    ]


def lines(folder: Path) -> list[bytes]:
    """Whole lines, in their order."""
    path = folder / "trials.jsonl"
    return path.read_bytes().split(b"\n")[:-1] if path.exists() else []


if __name__ == "__main__":
    sys.exit(main(*(int(x) for x in [*sys.argv[1:3], *("20", "0")[len(sys.argv) - 1 :]])))
