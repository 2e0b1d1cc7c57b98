"""What many trials cost: `python -m benchmarks.scale`, parts by --only operations, workers, rows, or page.

- operations: seconds of the processor that a trial takes, over the operations of generated assemblies.
- workers: trials a second with 1, 2 and 4 processes, and on a Ray cluster of this machine. Two sweeps of which one has
  twice the trials: what the longer takes more is counted, so that starts and compilations are not.
- rows: time and memory of `report` and `compare` with 100,000 and 1,000,000 rows that are made up: 1,000 cells with
  numbers that are drawn, so that nothing of them repeats.

Writes results/scale.json, each part by itself, and docs/results/scale.md (half an hour on a machine that does nothing
else; `--rows` takes other numbers of rows).
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from apo_bench import TrialSettings, build_scene, load_scenario, run_trial
from apo_bench.generated import FAMILIES
from apo_bench.records.run.run_folder import NUMBERS
from apo_bench.sweeps.grid import SweepSettings
from apo_bench.sweeps.sweep import run_sweep
from apo_bench.trial.stages import simulate_demonstration
from benchmarks.made_with import with_mujoco
from benchmarks.measured_parts import measured

ROOT = Path(__file__).resolve().parents[1]
RESULT = ROOT / "benchmarks" / "results" / "scale.json"
PAGE = ROOT / "docs" / "results" / "scale.md"
OPERATIONS = range(2, 12)
ASSEMBLIES = 4
"""With each number of operations."""
SWEEP = SweepSettings(("stick_in_tower", "carried_bridge"), (1.0,), (1.0,), ("none", "contact"), fidelity="contact")
SEEDS = 12
WAYS: tuple[tuple[str, int], ...] = (("local", 1), ("local", 2), ("local", 4), ("ray", 1), ("ray", 2))
ROWS = (100_000, 1_000_000)
MILLION = 1_000_000
CORES = 100
AXES: dict[str, Sequence[Any]] = {
    "scenario": ("stick_in_tower", "carried_bridge", "vanished_fixture", "pocket_table"),
    "careless": (0.0, 1.0),
    "noise": ("isotropic", "anisotropic", "per-part", "camera", "outliers"),
    "level": (0.1, 0.25, 0.5, 1.0, 2.0),
    "method": ("none", "contact", "paper", "paper-track", "snap"),
}
ENDINGS = (("attach", "force_stop"), ("judge", "gap"), ("judge", "overlap"), ("correct", "inconsistent"))


def operations() -> list[dict[str, Any]]:
    """Seconds of the processor, by the number of operations."""
    return [_of_size(count) for count in OPERATIONS]


def _of_size(count: int) -> dict[str, Any]:
    took = []
    for name in itertools.islice(_with_operations(count), ASSEMBLIES):
        began = time.process_time()
        scene = build_scene(load_scenario(name))
        simulate_demonstration(scene, 0.0, 0)
        compiled = time.process_time()
        shown = simulate_demonstration(scene, 0.0, 1)
        demonstrated = time.process_time()
        asked = TrialSettings(
            scenario=name, method="contact", seed=1, level_mm=1.0, level_deg=1.0, careless=0.0, fidelity="contact"
        )
        run_trial(asked, scene, simulated=shown)
        took.append((compiled - began, demonstrated - compiled, time.process_time() - demonstrated))
    first, shown_s, trial_s = (statistics.median(column) for column in zip(*took, strict=True))
    print(f"{count} operations: {first:.2f} s, {shown_s:.2f} s, {trial_s:.2f} s", flush=True)
    return {"operations": count, "first_s": first, "demonstrate_s": shown_s, "trial_s": trial_s}


def _with_operations(count: int) -> Iterator[str]:
    """Generated assemblies with so many operations, families in turn."""
    for seed in itertools.count():
        for family in FAMILIES:
            name = f"generated:{family}:{seed}"
            if len(load_scenario(name).assembly.operations) == count:
                yield name


def workers() -> list[dict[str, Any]]:
    """Trials a second, and what starting costs, for each way to run a sweep."""
    found = []
    for backend, count in WAYS:
        walls = {}
        for seeds in (SEEDS, 2 * SEEDS):
            with tempfile.TemporaryDirectory() as folder:
                address = "local" if backend == "ray" else None
                began = time.perf_counter()
                done = run_sweep(
                    replace(SWEEP, trials=seeds), Path(folder) / "run", workers=count, backend=backend, address=address
                )
                walls[len(done)] = time.perf_counter() - began
        (few, short), (many, long) = walls.items()
        each = (long - short) / (many - few)
        found.append({"backend": backend, "workers": count, "trial_s": each, "start_s": short - few * each})
        print(f"{backend}, {count}: {1 / each:.2f} trials/s, start {found[-1]['start_s']:.1f} s", flush=True)
    return found


def rows(counts: Sequence[int]) -> list[dict[str, Any]]:
    """Time and memory of `report` and `compare`."""
    found = []
    with tempfile.TemporaryDirectory() as top:
        for count in counts:
            folders = [Path(top) / f"{count}{side}" for side in "ab"]
            for folder in folders:
                folder.mkdir()
                with (folder / "trials.jsonl").open("w", encoding="utf-8") as file:
                    file.writelines(json.dumps(row) + "\n" for row in itertools.islice(made_up(), count))
            commands: dict[str, list[str]] = {
                "report": ["report", str(folders[0])],
                "compare": ["compare", *map(str, folders), "--out", str(Path(top) / "compare.html")],
            }
            for name, arguments in commands.items():
                cost = cost_of([sys.executable, "-m", "apo_bench", *arguments])
                found.append({"rows": count, "command": name, **cost._asdict()})
                print(found[-1], flush=True)
    return found


class Cost(NamedTuple):
    """Of a process."""

    wall_s: float
    processor_s: float
    peak_mb: float


def cost_of(command: Sequence[str]) -> Cost:
    """What a process costs that must end well."""
    began = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0, command
    return Cost(time.perf_counter() - began, used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3)


def made_up() -> Iterator[dict[str, Any]]:
    """Rows like one that was run, with numbers that are drawn; seeds first, as a sweep writes them."""
    with tempfile.TemporaryDirectory() as folder:
        grid = SweepSettings(("block_on_block",), (1.0,), (1.0,), ("contact",), trials=1, grasps=("weld",))
        (real,) = run_sweep(grid, Path(folder) / "run")
    rng = np.random.default_rng(0)
    for seed in itertools.count():
        for where in itertools.product(*AXES.values()):
            yield _row(rng, dict(real), seed, dict(zip(AXES, where, strict=True)))


def _row(rng: np.random.Generator, real: dict[str, Any], seed: int, where: dict[str, Any]) -> dict[str, Any]:
    success = bool(rng.random() < 0.9 / (1.0 + where["level"] * AXES["method"][::-1].index(where["method"]) / 4))
    stage, code = (None, None) if success else ENDINGS[int(rng.integers(len(ENDINGS)))]
    drawn = {name: float(x) for name, x in zip(NUMBERS, rng.lognormal(0.0, 2.0, len(NUMBERS)), strict=True)}
    ended = {"failure_stage": stage, "failure_code": code, "failure_operation": None if success else 3}
    verdicts = dict.fromkeys(("success", "as_demonstrated", "loose_success"), success)
    shares = {name: float(rng.random()) for name in ("p_value", "promised", "least_overlap")}
    whole = {"extra_operations": int(rng.integers(9)), "seed": seed, "level_deg": where["level"]}
    return real | drawn | ended | verdicts | shares | whole | where


def _page(found: dict[str, Any]) -> Iterator[str]:
    yield from ("# What many trials cost", "")
    yield "Written by `python -m benchmarks.scale`: times of one machine; ratios and memory are what to take from here."
    if "operations" in found:
        yield from ("", "## Over operations", "")
        yield f"Seconds of one core, medians of {ASSEMBLIES} generated assemblies each, `contact` at 1 mm and 1 degree,"
        yield "fidelity `contact`. A scene is made once in a process, a demonstration once for all methods of a seed."
        yield from ("", "| operations | scene, first demonstration | a demonstration | a trial with it |")
        yield "|---|---|---|---|"
        for line in found["operations"]:
            yield (
                f"| {line['operations']} | "
                + " | ".join(f"{line[name]:.2f}" for name in ("first_s", "demonstrate_s", "trial_s"))
                + " |"
            )
        each = [line["demonstrate_s"] + line["trial_s"] for line in found["operations"]]
        hours = [MILLION * seconds / CORES / 3600.0 for seconds in (min(each), statistics.median(each), max(each))]
        yield ""
        yield f"A million trials, each with a demonstration of its own, on {CORES} such cores: {hours[1]:.1f} hours at"
        yield f"the median over these sizes ({hours[0]:.1f} to {hours[2]:.1f}), not counting what is started and lost."
    if "workers" in found:
        yield from ("", "## Over workers", "", f"{' and '.join(SWEEP.scenarios)}, `none` and `contact`, two sweeps of")
        yield f"{SEEDS} and {2 * SEEDS} seeds; this machine has {found['cores']} cores."
        yield from (
            "",
            "| where | workers | trials a second | to one local worker | start, s |",
            "|---|---|---|---|---|",
        )
        one = found["workers"][0]["trial_s"]
        for line in found["workers"]:
            yield (
                f"| {line['backend']} | {line['workers']} | {1 / line['trial_s']:.2f} | {one / line['trial_s']:.2f} | "
                f"{line['start_s']:.0f} |"
            )
        ray = next(line["trial_s"] for line in found["workers"] if line["backend"] == "ray")
        yield from ("", f"Ray takes {1e3 * (ray - one):+.0f} ms a trial beside a local worker.")
    if "rows" in found:
        yield from ("", "## Rows", "", "A folder takes a million rows, which is the limit of a sweep.", "")
        yield from ("| command | rows | s | s of the processor | memory, GB |", "|---|---|---|---|---|")
        for line in found["rows"]:
            yield (
                f"| `{line['command']}` | {line['rows']:,} | {line['wall_s']:.0f} | {line['processor_s']:.0f} | "
                f"{line['peak_mb'] / 1e3:.1f} |"
            )


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--only", choices=("operations", "workers", "rows", "page"), action="append")
    asked.add_argument("--rows", type=int, nargs="+", default=list(ROWS))
    given = asked.parse_args()
    parts: dict[str, Callable[[], Any]] = {
        "operations": operations,
        "workers": workers,
        "rows": lambda: rows(given.rows),
    }
    found = measured(parts, given.only, RESULT)
    PAGE.write_text(with_mujoco("\n".join(_page(found)) + "\n", [found["mujoco"]]), encoding="utf-8")


if __name__ == "__main__":
    main()
