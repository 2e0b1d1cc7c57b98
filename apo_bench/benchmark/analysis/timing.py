"""Wall times of trials and workers, from `timing.jsonl`."""

import os
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.benchmark.analysis.condition import rank_method
from apo_bench.benchmark.analysis.table_line import Line
from apo_bench.geometry import Array
from apo_bench.io import read_lines
from apo_bench.records.run.validation import decode_timing

_PARTS = ("compile_s", "demonstrate_s", "trial_s")  # parts of a worker's time


def read_timing(folder: Path) -> Iterator[dict[str, Any]]:
    """Yield the lines of `timing.jsonl` whose trial was timed; none if there is no such file.

    Raises:
        InputError: The file cannot be read, or a line is invalid; the sentence names file, line and field.
    """
    path = folder / "timing.jsonl"
    if not os.path.lexists(path):
        return
    for number, text in read_lines(path, "table of timings"):
        line = decode_timing(text, f"{path}, line {number}")
        if line["trial_s"] is not None:
            yield line


def tabulate_timing(lines: Iterable[Mapping[str, Any]]) -> tuple[list[Line], list[Line]]:
    """Return wall times of trials, and the work of workers.

    Returns:
        One line per scenario and method: percentiles and sum [s] of trial times, without demonstration and
        compilation. One line per host and worker, with its rate of trials over its busy time.
    """
    trial_s: dict[tuple[str, str], array[float]] = {}
    busy_s: dict[tuple[str, str], array[float]] = {}
    for line in lines:
        trial_s.setdefault((line["scenario"], line["method"]), array("d")).append(line["trial_s"])
        worker = str(line.get("host")), str(line.get("worker"))
        busy_s.setdefault(worker, array("d")).append(sum(line.get(part) or 0.0 for part in _PARTS))
    methods = sorted(trial_s, key=lambda key: (key[0], rank_method(key[1]), key[1]))
    times = [_times(scenario, method, np.array(trial_s[scenario, method])) for scenario, method in methods]
    return times, [_work(host, worker, busy) for (host, worker), busy in sorted(busy_s.items())]


def _times(scenario: str, method: str, seconds: Array) -> Line:
    """Return the line of a scenario and method."""
    low, middle, high = np.percentile(seconds, (5, 50, 95)).tolist()
    return {
        "scenario": scenario,
        "method": method,
        "trials": len(seconds),
        "trial_5_s": low,
        "trial_median_s": middle,
        "trial_95_s": high,
        "trial_sum_s": float(seconds.sum()),
    }


def _work(host: str, worker: str, busy_s: Sequence[float]) -> Line:
    """Return the line of a worker."""
    whole_s = sum(busy_s)
    rate = 60.0 * len(busy_s) / whole_s if whole_s > 0 else 0.0
    return {"host": host, "worker": worker, "trials": len(busy_s), "busy_s": whole_s, "rows_per_minute": rate}
