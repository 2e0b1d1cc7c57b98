"""How well the range finder locates: per scene and level, against what was really shown.

    python benchmarks/eye.py --trials 30 --noise-level 1 --scenarios stick_in_tower carried_bridge --out eye.json

Each demonstration is simulated and watched once per seed; every level senses the same images anew. No robot is needed.
`shifted_mm` is how far parts that were not manipulated were shifted by the late operation, `noticed` how many pixels of
such parts stand in the regions of what changed then, and `surprises` how often something had moved for the eye that was
not expected.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

from apo_bench.assembly import placements
from apo_bench.geometry import pose
from apo_bench.perception.depth_camera.follow import Event
from apo_bench.scenario.file import load_scenario, scenario_names
from apo_bench.simulation.scene.scene import Scene, build_scene
from apo_bench.simulation.sensor.rays import ModelRays
from apo_bench.trial.stages import OBSERVATION, SimulatedDemonstration, range_sensor, simulate_demonstration, stream


def measured(scene: Scene, shown: SimulatedDemonstration, noise_mm: float, seed: int) -> list[dict[str, object]]:
    """One entry per operation."""
    pose_source = range_sensor(scene, shown, noise_mm)
    began = time.process_time()
    events = pose_source.events(shown.demonstration, pose_source.sensed(stream(seed, OBSERVATION)))
    seconds = time.process_time() - began
    of = {event.operation: event for event in events if event.found is not None}
    rows = []
    for k in range(len(shown.demonstration.assembly)):
        row = {"operation": k + 1, "seed": seed, "noise_mm": noise_mm, "found": k in of, "locate_s": seconds}
        found = of[k].found if k in of else None
        if found is not None:
            xi = pose.log(pose.inverse(found.T) @ shown.demonstration.poses[k])
            row["mm"] = 1e3 * np.linalg.norm(xi[:3])
            row["deg"] = np.degrees(np.linalg.norm(xi[3:]))
            row["chi_square"] = float(xi @ np.linalg.solve(found.covariance, xi))
        rows.append(row)
    rows[-1]["surprises"] = sum(event.operation is None for event in events)
    rows[-1]["noticed"] = noticed(scene, shown, events[-1]) if events else 0
    return rows


def shifted(shown: SimulatedDemonstration) -> dict[str, np.ndarray]:
    """Parts that rested and were shifted late, with the pose in which each was seen."""
    demonstration = shown.demonstration
    last = {operation.main: k for k, operation in enumerate(demonstration.assembly.operations)}
    carried = {part for operation in demonstration.assembly.operations for part in operation.carries}
    before = {part: demonstration.poses[k] for part, k in last.items() if part not in carried}
    return {part: T for part, T in before.items() if distance_mm(shown, part, T) > 0.5}


def distance_mm(shown: SimulatedDemonstration, part: str, T: np.ndarray) -> float:
    return 1e3 * float(np.linalg.norm((shown.demonstration.final[part] - T)[:3, 3]))


def noticed(scene: Scene, shown: SimulatedDemonstration, event: Event) -> int:
    """Pixels of shifted parts in the regions of the last operation: appeared where they are, vanished where they were.

    Per part some 1500 can be seen in both views together.
    """
    parts = shifted(shown)
    demonstration = shown.demonstration
    stages = (demonstration.start, *placements(demonstration.assembly, demonstration.start, demonstration.poses))
    solids = scene.scenario.assembly.solids
    models = ModelRays(solids, 1e-3 * scene.clearance_mm)
    owner = np.array([*solids, "nothing"])
    count = 0
    for view, region in zip(shown.images.finder.views, event.regions, strict=True):
        for mask, poses in ((region.appeared, demonstration.final), (region.vanished, stages[-2])):
            pixels = np.flatnonzero(mask)
            _, number = models({part: poses[part] for part in solids}, view.origin, view.rays[pixels])
            count += int(np.isin(owner[number], list(parts)).sum())
    return count


def main() -> None:
    """Measure, print a table, write everything."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=30)
    parser.add_argument("--noise-level", type=float, nargs="+", default=[1.0])
    parser.add_argument("--scenarios", nargs="+", default=list(scenario_names()))
    parser.add_argument("--human-error-scale", type=float, default=1.0)
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    everything = {}
    print("| scenario | level | found | mm: median, 90 %, most | deg | chi-square / 6 | shifted, noticed, surprises |")
    print("|---|---|---|---|---|---|---|")
    for name in args.scenarios:
        scene = build_scene(load_scenario(name))
        rows = []
        moved = []
        watch = []
        for seed in range(args.trials):
            began = time.process_time()
            shown = simulate_demonstration(scene, args.human_error_scale, seed, "range")
            watch.append(time.process_time() - began)
            if shown.demonstration.code != "ok":
                continue
            moved.append(max((distance_mm(shown, *item) for item in shifted(shown).items()), default=0.0))
            for noise_mm in args.noise_mm:
                rows += measured(scene, shown, noise_mm, seed)
        everything[name] = {"rows": rows, "shifted_mm": moved, "watch_s": watch}
        for noise_mm in args.noise_mm:
            print(line(name, noise_mm, [row for row in rows if row["noise_mm"] == noise_mm], moved), flush=True)
        seconds = [row["locate_s"] for row in rows if row["operation"] == 1]
        print(f"<!-- watch {np.mean(watch):.2f} s, locate {np.mean(seconds):.2f} s of CPU -->", flush=True)
    if args.out:
        args.out.write_text(json.dumps(everything, indent=1) + "\n", encoding="utf-8")


def line(name: str, noise_mm: float, rows: list[dict[str, object]], moved: list[float]) -> str:
    """One line of the table."""
    found = [row for row in rows if row["found"]]
    mm, deg, chi = (np.array([row[key] for row in found], dtype=float) for key in ("mm", "deg", "chi_square"))
    three = [" ".join(f"{x:.2f}" for x in (np.median(a), np.quantile(a, 0.9), a.max())) for a in (mm, deg)]
    surprises, pixels = (sum(int(row.get(key, 0)) for row in rows) for key in ("surprises", "noticed"))
    return (
        f"| {name} | {noise_mm:g} | {len(found)} of {len(rows)} | {three[0]} | {three[1]} | {chi.mean() / 6:.2f} "
        f"| {min(moved):.1f} to {max(moved):.1f} mm, {pixels} pixels, {surprises} |"
    )


if __name__ == "__main__":
    main()
