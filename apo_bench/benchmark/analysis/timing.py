"""Wall times of trials and workers, from `timing.jsonl`."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.benchmark.analysis.condition import rank_method
from apo_bench.benchmark.analysis.table_line import Line
from apo_bench.io import group_by, read_lines
from apo_bench.records.run.validation import timing_of

_PARTS = ("compile_s", "demonstrate_s", "trial_s")  # parts of a worker's time


def read_timing(folder: Path) -> list[dict[str, Any]]:
    """Read the lines of `timing.jsonl` whose trial was timed; none if there is no such file.

    Raises:
        InputError: The file cannot be read, or a line is invalid; the sentence names file, line and field.
    """
    path = folder / "timing.jsonl"
    if not os.path.lexists(path):
        return []
    lines = [timing_of(line, f"{path}, line {number}") for number, line in read_lines(path, "table of timings")]
    return [line for line in lines if line["trial_s"] is not None]


def tabulate_trial_times(lines: Iterable[Mapping[str, Any]]) -> list[Line]:
    """Return one line per scenario and method: percentiles and sum [s] of trial times.

    The times exclude demonstration and compilation.
    """
    times = group_by(((line["scenario"], line["method"]), line["trial_s"]) for line in lines)
    made = []
    for scenario, method in sorted(times, key=lambda key: (key[0], rank_method(key[1]), key[1])):
        seconds = np.array(times[scenario, method], dtype=float)
        low, middle, high = np.percentile(seconds, (5, 50, 95)).tolist()
        made.append(
            {
                "scenario": scenario,
                "method": method,
                "trials": len(seconds),
                "trial_5_s": low,
                "trial_median_s": middle,
                "trial_95_s": high,
                "trial_sum_s": float(seconds.sum()),
            }
        )
    return made


def tabulate_work(lines: Iterable[Mapping[str, Any]]) -> list[Line]:
    """Return one line per host and worker, with its rate of trials over its busy time."""
    workers = group_by(
        ((str(line.get("host")), str(line.get("worker"))), sum(line.get(part) or 0.0 for part in _PARTS))
        for line in lines
    )
    return [
        {
            "host": host,
            "worker": worker,
            "trials": len(busy),
            "busy_s": sum(busy),
            "rows_per_minute": 60.0 * len(busy) / sum(busy) if sum(busy) > 0 else 0.0,
        }
        for (host, worker), busy in sorted(workers.items())
    ]
