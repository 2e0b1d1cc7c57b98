"""Runs one peer in a process of its own and ends it when its time is over (SIGKILL: some ignore anything less)."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array

ROOT = Path(__file__).resolve().parents[2]
LIMIT_S = 60.0
ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")}


class Ran(NamedTuple):
    """What a process left behind."""

    goals: Array
    """(k, n, 4, 4), NaN where the peer raised; as many draws as it finished."""
    ms: Array
    """(k, 1 + beside), of the processor: its own time first, then those of what ran beside it; -1 where one raised."""
    wall_ms: Array
    """(k, 1 + beside): the same by the clock."""
    ended: str
    """`ok`, `killed`, or the last line of what it said when it crashed."""
    seconds: float


def run(
    peer: str,
    problem: str,
    noise_level: str,
    draws: int,
    *,
    first: int = 0,
    per_part: bool = False,
    beside: tuple[str, ...] = (),
    limit_s: float = LIMIT_S,
) -> Ran:
    """Draws `first` to `first + draws` by one peer, others timed beside it in turn."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "out.npz"
        seeds = f"{first}:{first + draws}"
        arguments = [peer, problem, noise_level, str(int(per_part)), seeds, str(out), ",".join(beside)]
        ended, seconds = process(["-m", "benchmarks.corrector_bench.worker", *arguments], limit_s)
        if not out.exists():
            none = np.zeros((0, 1 + len(beside)))
            return Ran(np.zeros((0, 0, 4, 4)), none, none, ended, seconds)
        with np.load(out) as left:
            return Ran(left["goals"], left["ms"], left["wall_ms"], ended, seconds)


def process(arguments: list[str], limit_s: float) -> tuple[str, float]:
    """Runs Python with these arguments from the root of the project; how it ended, and after how many seconds."""
    start = time.monotonic()
    child = subprocess.Popen(
        [sys.executable, *arguments],
        cwd=ROOT,
        env={**os.environ, **ONE_THREAD},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        _, said = child.communicate(timeout=limit_s)
    except subprocess.TimeoutExpired:
        child.kill()
        child.communicate()
        return "killed", time.monotonic() - start
    last = said.strip().splitlines()[-1] if said.strip() else f"exit code {child.returncode}"
    return ("ok" if child.returncode == 0 else last), time.monotonic() - start
