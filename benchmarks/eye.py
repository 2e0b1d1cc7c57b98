"""How well the range finder locates: per scene and level, against what was really shown.

    python benchmarks/eye.py --trials 30 --levels 1 --scenarios stick_in_tower carried_bridge --out eye.json

Each demonstration is simulated and watched once per seed; every level senses the same images anew. No robot is needed.
`moved_mm` is how far parts that were not manipulated were shifted by the late operation, and `noticed` counts the
operations at which the eye took such a part for moved.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

from apo_bench.benchmark.stages import OBSERVATION, Shown, show, stream, through
from apo_bench.geometry import pose
from apo_bench.scenario_file import load_scenario, scenario_names
from apo_bench.simulation.scene import Scene, build_scene


def measured(scene: Scene, shown: Shown, level: float, seed: int) -> list[dict[str, object]]:
    """One entry per operation."""
    eye = through(scene, shown, level)
    began = time.process_time()
    events = eye.events(shown.demonstration, eye.sensed(stream(seed, OBSERVATION)))
    seconds = time.process_time() - began
    of = {event.operation: event for event in events if event.found is not None}
    rows = []
    for k, operation in enumerate(shown.demonstration.assembly.operations):
        row = {"operation": k + 1, "seed": seed, "level": level, "found": k in of, "locate_s": seconds}
        row["noticed"] = any(event.moved - set(operation.moves) for event in events if event.operation == k)
        found = of[k].found if k in of else None
        if found is not None:
            xi = pose.log(pose.inverse(found.T) @ shown.demonstration.goals[k])
            row["mm"], row["deg"] = 1e3 * np.linalg.norm(xi[:3]), np.degrees(np.linalg.norm(xi[3:]))
            row["chi_square"] = float(xi @ np.linalg.solve(found.covariance, xi))
        rows.append(row)
    return rows


def shifted_mm(shown: Shown) -> float:
    """How far the late, hidden adjustment moved parts that rested, at most."""
    demonstration = shown.demonstration
    last = {operation.main: k for k, operation in enumerate(demonstration.assembly.operations)}
    carried = {part for operation in demonstration.assembly.operations for part in operation.carries}
    return max(
        (
            1e3 * float(np.linalg.norm((demonstration.final[part] - demonstration.goals[k])[:3, 3]))
            for part, k in last.items()
            if part not in carried
        ),
        default=0.0,
    )


def main() -> None:
    """Measure, print a table, write everything."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=30)
    parser.add_argument("--levels", type=float, nargs="+", default=[1.0])
    parser.add_argument("--scenarios", nargs="+", default=list(scenario_names()))
    parser.add_argument("--careless", type=float, default=1.0)
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    everything = {}
    print("| scenario | level | found | mm: median, 90 %, most | deg: the same | chi-square / 6 | moved, noticed |")
    print("|---|---|---|---|---|---|---|")
    for name in args.scenarios:
        scene = build_scene(load_scenario(name))
        rows, moved, watch = [], [], []
        for seed in range(args.trials):
            began = time.process_time()
            shown = show(scene, args.careless, seed, "range")
            watch.append(time.process_time() - began)
            if shown.demonstration.code != "ok":
                continue
            moved.append(shifted_mm(shown))
            for level in args.levels:
                rows += measured(scene, shown, level, seed)
        everything[name] = {"rows": rows, "moved_mm": moved, "watch_s": watch}
        for level in args.levels:
            print(line(name, level, [row for row in rows if row["level"] == level], moved), flush=True)
        seconds = [row["locate_s"] for row in rows if row["operation"] == 1]
        print(f"<!-- watch {np.mean(watch):.2f} s, locate {np.mean(seconds):.2f} s of CPU -->", flush=True)
    if args.out:
        args.out.write_text(json.dumps(everything, indent=1) + "\n", encoding="utf-8")


def line(name: str, level: float, rows: list[dict[str, object]], moved: list[float]) -> str:
    """One line of the table."""
    found = [row for row in rows if row["found"]]
    mm, deg, chi = (np.array([row[key] for row in found], dtype=float) for key in ("mm", "deg", "chi_square"))
    three = [" ".join(f"{x:.2f}" for x in (np.median(a), np.quantile(a, 0.9), a.max())) for a in (mm, deg)]
    noticed = sum(bool(row["noticed"]) for row in rows)
    return (
        f"| {name} | {level:g} | {len(found)} of {len(rows)} | {three[0]} | {three[1]} | {chi.mean() / 6:.2f} "
        f"| {min(moved):.1f} to {max(moved):.1f} mm, {noticed} |"
    )


if __name__ == "__main__":
    main()
