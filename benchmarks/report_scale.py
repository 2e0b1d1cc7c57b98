"""How long the report of a large sweep takes, and how large its page is: `python benchmarks/report_scale.py [ROWS]`.

The rows are made up: 1,000 cells with numbers that are drawn, so that nothing of them repeats. No picture is drawn.
"""

from __future__ import annotations

import itertools
import json
import resource
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.records import ROW
from apo_bench.records.run.run_folder import NUMBERS
from apo_bench.report.report import report

SCENARIOS = ("stick_in_tower", "carried_bridge", "vanished_fixture", "pocket_table")
NOISES = ("isotropic", "anisotropic", "per-part", "camera", "outliers")
LEVELS = (0.1, 0.25, 0.5, 1.0, 2.0)
METHODS = ("none", "contact", "paper", "paper-track", "snap")
ENDINGS = (("attach", "force_stop"), ("judge", "gap"), ("judge", "overlap"), ("correct", "inconsistent"))


def main() -> None:
    many = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    with tempfile.TemporaryDirectory() as folder:
        with (Path(folder) / "trials.jsonl").open("w", encoding="utf-8") as file:
            file.writelines(json.dumps(row) + "\n" for row in itertools.islice(rows(), many))
        began = time.perf_counter()
        busy = time.process_time()
        made = report(folder)
        took = time.perf_counter() - began
        worked = time.process_time() - busy
        size = made.page.stat().st_size / 1e6
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(f"{many} rows, {len(made.cells)} cells: {took:.1f} s ({worked:.1f} s of the processor), page {size:.1f} MB")
    print(f"peak memory {peak:.0f} MB")


def rows() -> Iterator[dict[str, Any]]:
    """Seeds first, as a sweep writes them."""
    rng = np.random.default_rng(0)
    axes = (SCENARIOS, (0.0, 1.0), NOISES, LEVELS, METHODS)
    for seed in itertools.count():
        for scenario, careless, noise, level, method in itertools.product(*axes):
            yield row(rng, seed, scenario=scenario, careless=careless, noise=noise, level=level, method=method)


def row(rng: np.random.Generator, seed: int, **where: Any) -> dict[str, Any]:
    """What a report looks at, and as much again that it does not."""
    success = bool(rng.random() < 0.9 / (1.0 + where["level"] * METHODS[::-1].index(where["method"]) / 4))
    stage, code = (None, None) if success else ENDINGS[int(rng.integers(len(ENDINGS)))]
    drawn = {name: float(x) for name, x in zip(NUMBERS, rng.lognormal(0.0, 2.0, len(NUMBERS)), strict=True)}
    drawn |= {"p_value": float(rng.random()), "extra_operations": int(rng.integers(9))}
    poses = {part: rng.normal(0.0, 100.0, 7).tolist() for part in ("castle1", "castle2", "stick", "table")}
    return {
        "schema": ROW,
        "spec_hash": "0" * 16,
        "seed": seed,
        "level_deg": where["level"],
        "clearance_mm": 0.25,
        "eye": "noise",
        "grasp": "friction",
        "arm": "six_axis",
        "relations": "given",
        "fidelity": "full",
        "timestep_s": 0.001,
        "demonstration": "ok",
        "success": success,
        "as_demonstrated": success,
        "loose_success": success,
        "failure_stage": stage,
        "failure_code": code,
        "failure_operation": None if success else 3,
        "sentence": "every operation was carried out" if success else "faces that should touch overlap too little",
        "predicted": {"fails": not success, "operation": None if success else 3, "code": "ok", "size_mm": 0.1},
        "freed": [3, 2, 1],
        "reached": poses,
        **where,
        **drawn,
    }


if __name__ == "__main__":
    main()
