"""Wall times of trials, and what the workers of a sweep did, from `timing.jsonl`."""

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.benchmark.analysis.condition import rank
from apo_bench.benchmark.analysis.line import Line
from apo_bench.io import each_line, grouped
from apo_bench.records.run.validation import timing_of

_PARTS = ("compile_s", "demonstrate_s", "trial_s")


def read_timing(folder: Path) -> list[dict[str, Any]]:
    """The lines of trials that were timed; none if there is no such file.

    Raises:
        InputError: The file cannot be read, or a line is none; one sentence with file, line and field.
    """
    path = folder / "timing.jsonl"
    if not os.path.lexists(path):
        return []
    lines = [timing_of(line, f"{path}, line {number}") for number, line in each_line(path, "table of timings")]
    return [line for line in lines if line["trial_s"] is not None]


def trial_times(lines: Iterable[Mapping[str, Any]]) -> list[Line]:
    """One line per scenario and method: percentiles and sum [s] of trials without demonstration and compilation."""
    times = grouped(((line["scenario"], line["method"]), line["trial_s"]) for line in lines)
    made = []
    for scenario, method in sorted(times, key=lambda key: (key[0], rank(key[1]), key[1])):
        seconds = np.array(times[scenario, method], dtype=float)
        names = ("trial_5_s", "trial_median_s", "trial_95_s")
        percentiles = dict(zip(names, np.percentile(seconds, (5, 50, 95)).tolist(), strict=True))
        counted = {"scenario": scenario, "method": method, "trials": len(seconds)}
        made.append(counted | percentiles | {"trial_sum_s": float(seconds.sum())})
    return made


def work(lines: Iterable[Mapping[str, Any]]) -> list[Line]:
    """One line per host and worker, with the rate over the time in which it was busy."""
    busy = grouped((_worker(line), sum(line.get(part) or 0.0 for part in _PARTS)) for line in lines)
    return [
        {
            "host": host,
            "worker": worker,
            "trials": len(seconds),
            "busy_s": sum(seconds),
            "rows_per_minute": 60.0 * len(seconds) / sum(seconds) if sum(seconds) > 0 else 0.0,
        }
        for (host, worker), seconds in sorted(busy.items())
    ]


def _worker(line: Mapping[str, Any]) -> tuple[str, str]:
    host, worker = ("" if line.get(key) is None else str(line[key]) for key in ("host", "worker"))
    return host, worker
