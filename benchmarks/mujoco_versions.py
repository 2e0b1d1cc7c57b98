"""What another version of MuJoCo changes: trials, and the numbers of `docs/how/simulated.md`.

Run `python benchmarks/mujoco_versions.py --write FILE` in an environment of each version, then
`python benchmarks/mujoco_versions.py FILE FILE`, older first. The same trials are run in all scenarios, and near the
border of the clearance, where half the time step changes some verdicts too. Writes `results/mujoco_versions.json` and
the tables in `docs/how/simulated.md`, without files only these (five minutes for each version on one idle core).
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OMP_NUM_THREADS", "1")

import mujoco
import numpy as np

from apo_bench import Plan, Scene, TrialSettings, build_scene, draw_layout, load_scenario, replay, run_trial
from apo_bench.geometry import pose
from apo_bench.parts.making import extrude, rectangle
from apo_bench.scenario.file import scenario_names
from apo_bench.simulation.robot.robot import Robot
from apo_bench.simulation.robot.wrist import ForceSensors
from apo_bench.simulation.scene.world import initial_state, place
from tests.round_scenes import peg_in_hole
from tests.simulation.test_grasping import SIDEWAYS, one_part

ROOT = Path(__file__).resolve().parent.parent
KEPT = ROOT / "benchmarks" / "results" / "mujoco_versions.json"
PAGE = ROOT / "docs" / "how" / "simulated.md"
FIRST = "<!-- written by benchmarks/mujoco_versions.py -->"
LAST = "<!-- until here -->"
METHODS = ("oracle", "none", "contact")
BORDER = {"stick_in_tower": (0.05, 0.1, 0.2), "stick_on_castles": (0.05, 0.1, 0.2)}
"""Levels near the border of the clearance, as seen by a careful human."""
CARRIED = ("stick_in_tower", "shaft_through_brackets", "dovetail", "peg_in_hole", "nested_bushings", "stick_on_castles")
TOLD = ("success", "as_demonstrated", "failure_stage", "failure_code", "failure_operation")


def cases(seeds: int) -> Iterator[tuple[str, TrialSettings]]:
    """Group -> trial."""
    for name, method, seed in product(scenario_names(), METHODS, range(seeds)):
        yield "all scenarios", settings(name, method, seed, 0.0 if method == "oracle" else 2.0, careless=1.0)
    for name, levels in BORDER.items():
        for level, seed in product(levels, range(2 * seeds)):
            yield "near the border", settings(name, "none", seed, level, careless=0.0)


def settings(name: str, method: str, seed: int, level: float, careless: float) -> TrialSettings:
    return TrialSettings(
        scenario=name,
        method=method,
        seed=seed,
        level_mm=level,
        level_deg=level,
        careless=0.0 if method == "oracle" else careless,
        fidelity="contact",
    )


def true_plan(scene: Scene, seed: int = 1) -> Plan:
    """Where every part belongs, without an error."""
    layout = draw_layout(scene.scenario, np.random.default_rng([seed, 0]), scene.clearance_mm)
    return Plan(scene.scenario.assembly, layout.start, layout.goals)


def creep() -> dict[str, float]:
    """How far what is carried creeps in the hand [mm]: by itself at the median, and as simulated at most."""
    steady = Robot.steady
    found = {}
    for name in CARRIED:
        scene = build_scene(load_scenario(name))
        asis = [1e3 * each.carried_m for each in replay(true_plan(scene), scene).in_hand]
        Robot.steady = lambda robot, on: None  # type: ignore[method-assign]
        try:
            alone = [1e3 * each.carried_m for each in replay(true_plan(scene), scene).in_hand]
        finally:
            Robot.steady = steady  # type: ignore[method-assign]
        found[f"creep in the hand, `{name}`, by itself, median [mm]"] = float(np.median(alone))
        found[f"creep in the hand, `{name}`, as simulated, most [mm]"] = max(asis)
    return found


def forces() -> dict[str, float]:
    """Of hard parts that touch: the largest force of one step, and behind the filter of the wrist [N]."""
    net = ForceSensors.net
    single = [0.0]

    def look(sensors: ForceSensors) -> list[float]:
        force = net(sensors)
        single[0] = max(single[0], float(np.linalg.norm(force)))
        return force

    scene = build_scene(load_scenario("stick_in_tower"))
    ForceSensors.net = look  # type: ignore[method-assign]
    try:
        peak = replay(true_plan(scene), scene, fidelity="contact").peak_force_n
    finally:
        ForceSensors.net = net  # type: ignore[method-assign]
    return {"force of a single step, `stick_in_tower`, most [N]": single[0], "behind the filter, most [N]": peak}


def friction(folder: Path) -> dict[str, float]:
    """How far a cube of 96 g moves in the hand at a friction of its own [mm]."""
    scene = one_part(folder, extrude(rectangle(60, 40), 0, 40, bottom="bottom"), SIDEWAYS, friction=0.2)
    model = scene.work.model
    part = (*scene.work.free, *scene.work.fixed).index("part")
    found = {}
    for mu in (0.02, 0.04):
        model.geom_friction[np.asarray(scene.work.geom_part) == part, 0] = mu
        moved = replay(true_plan(scene), scene).in_hand
        found[f"a cube of 96 g with a friction of {mu} moves in the hand [mm]"] = max(
            (1e3 * each.moved_m for each in moved), default=float("inf")
        )
    return found


def rest(folder: Path) -> dict[str, float]:
    """Contacts of a bored plate with the table, and how fast a shaft that stands rocks [rad/s]."""
    scene = build_scene(peg_in_hole(folder))
    shown = scene.shown
    data = initial_state(shown, scene.scenario.start)
    place(shown, data, "peg", pose.at((0.1, 0.1, 0.025)))
    mujoco.mj_step(shown.model, data, 50)
    plate, table = ((*shown.free, *shown.fixed).index(part) for part in ("plate", "table"))
    pairs = [{int(shown.geom_part[g]) for g in pair} for pair in data.contact.geom]
    rocks = 0.0
    v = shown.dof["peg"]
    for _ in range(1500):
        mujoco.mj_step(shown.model, data)
        rocks = max(rocks, float(np.linalg.norm(data.qvel[v + 3 : v + 6])))
    found = {"points at which a bored plate rests on the table": float(pairs.count({plate, table}))}
    return found | {"a shaft that was put down rocks in 1.5 s at most by [rad/s]": rocks}


def measured(seeds: int) -> dict[str, Any]:
    rows = []
    scenes: dict[str, Scene] = {}
    for group, asked in cases(seeds):
        if asked.scenario not in scenes:
            scenes[asked.scenario] = build_scene(load_scenario(asked.scenario))
        row = run_trial(asked, scenes[asked.scenario])
        key = [asked.scenario, asked.method, asked.level_mm, asked.seed]
        rows.append({"group": group, "key": key, "told": [row[name] for name in TOLD], "reached": row["reached"]})
    with tempfile.TemporaryDirectory() as folder:
        probes = creep() | forces() | friction(Path(folder)) | rest(Path(folder))
    return {"mujoco": mujoco.__version__, "seeds": seeds, "rows": rows, "probes": probes}


def compared(older: Mapping[str, Any], newer: Mapping[str, Any]) -> dict[str, Any]:
    """What is kept: of each group of trials how many succeed and how many end otherwise, and the other numbers."""
    pairs = list(zip(older["rows"], newer["rows"], strict=True))
    assert all(a["key"] == b["key"] for a, b in pairs)
    groups = []
    for group in dict.fromkeys(row["group"] for row in older["rows"]):
        mine = [(a, b) for a, b in pairs if a["group"] == group]
        groups.append(
            {
                "group": group,
                "trials": len(mine),
                "successes": [sum(bool(pair[k]["told"][0]) for pair in mine) for k in (0, 1)],
                "verdicts that differ": [a["key"] for a, b in mine if a["told"][:2] != b["told"][:2]],
                "otherwise failed": [a["key"] for a, b in mine if a["told"][2:] != b["told"][2:]],
                "same bits": sum(a["reached"] == b["reached"] for a, b in mine),
            }
        )
    measures = {name: [value, newer["probes"][name]] for name, value in older["probes"].items()}
    return {"versions": [older["mujoco"], newer["mujoco"]], "groups": groups, "measures": measures}


def tables(kept: Mapping[str, Any]) -> str:
    """Both tables of the page."""
    older, newer = kept["versions"]
    lines = [
        f"| | trials | success with {older} | with {newer} | verdicts that differ | fail otherwise | same bits |",
        "|---|---|---|---|---|---|---|",
    ]
    for each in kept["groups"]:
        won = " | ".join(str(n) for n in each["successes"])
        differ = [tuple(key) for key in each["verdicts that differ"]]
        otherwise = len([key for key in each["otherwise failed"] if tuple(key) not in differ])
        lines.append(
            f"| {each['group']} | {each['trials']} | {won} | {len(differ)} | {otherwise} | {each['same bits']} |"
        )
    lines += ["", f"| measured | {older} | {newer} |", "|---|---|---|"]
    lines += [f"| {name} | {a:.3g} | {b:.3g} |" for name, (a, b) in kept["measures"].items()]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", type=Path, help="what --write wrote, older version first")
    parser.add_argument("--write", type=Path, help="measure, and write it here")
    parser.add_argument("--seeds", type=int, default=5)
    asked = parser.parse_args()
    if asked.write:
        asked.write.write_text(json.dumps(measured(asked.seeds)) + "\n", encoding="utf-8")
        return
    if asked.files:
        found = compared(*(json.loads(path.read_text(encoding="utf-8")) for path in asked.files))
        KEPT.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    written = tables(json.loads(KEPT.read_text(encoding="utf-8")))
    before, rest = PAGE.read_text(encoding="utf-8").split(FIRST)
    PAGE.write_text(f"{before}{FIRST}\n\n{written}\n\n{LAST}{rest.split(LAST)[1]}", encoding="utf-8")


if __name__ == "__main__":
    main()
