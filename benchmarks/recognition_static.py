"""Contacts decided one by one and contacts decided together: `python benchmarks/recognition_static.py [DRAWS]` (ten
minutes for 24 draws of each scenario).

Layouts as they are drawn, nothing simulated: every contact of the scenario is exactly closed, and what was seen is that
with isotropic noise. Both ways of recognising get the same draws. Writes results/recognition_static.json and the table
in docs/how/recognition.md.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import json
import sys
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.assembly import Demonstration, Observation
from apo_bench.observation.noise import Level, make_noise
from apo_bench.scenario.file import load_scenario, scenario_names
from apo_bench.scenario.layout import draw_layout
from apo_bench.trial.recognised_contacts import count_contacts, recognise_by

HERE = Path(__file__).parent
KEPT = HERE / "results" / "recognition_static.json"
PAGE = HERE.parent / "docs" / "how" / "recognition.md"
BEGIN = "<!-- table: python benchmarks/recognition_static.py -->"
END = "<!-- end of static table -->"
LEVELS = (0.5, 1.0, 2.0, 4.0)
KINDS = ("recognised", "recognised-jointly")
SURE = (0.0, 0.5, 0.9, 0.99, 1.01)
"""Sets are counted by how likely they say that they are, between these."""


def main(draws: int = 24) -> None:
    rows = list[dict[str, Any]]()
    for level in LEVELS:
        for scenario in scenario_names():
            rows += [row(scenario, seed, level, kind) for seed in range(draws) for kind in KINDS]
        print("\n".join(table(rows)), flush=True)
    wrong = [r for r in rows if not right(r)]
    KEPT.write_text(json.dumps({"draws": draws, "wrong": wrong}, indent=1) + "\n", encoding="utf-8")
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
    middle = "\n".join([*table(rows), "", *by_scenario(rows), "", *by_probability(rows)])
    PAGE.write_text(f"{before}{BEGIN}\n\n{middle}\n\n{END}{rest.split(END)[1]}", encoding="utf-8")
    print(middle)


def seen(scenario: str, seed: int, level: float) -> Observation:
    known = load_scenario(scenario)
    rng = np.random.default_rng([seed, 20])
    layout = draw_layout(known, rng, 0.0)
    still = np.zeros((len(layout.goals), 6, 6))
    play_m = 1e-3 * known.clearance_mm
    shown = Demonstration(known.assembly, layout.start, layout.goals, layout.start, still, play_m=play_m)
    noisy = make_noise("isotropic", Level(level, level))(known.assembly, shown, rng)
    return Observation(known.assembly, noisy.start, noisy.goals, noisy.covariance, noisy.seen, play_m=play_m)


def row(scenario: str, seed: int, level: float, kind: str) -> dict[str, Any]:
    observation = seen(scenario, seed, level)
    begun = time.process_time()
    found = recognise_by(observation, kind)
    took = time.process_time() - begun
    counts = count_contacts(observation.assembly, found.assembly)
    return {
        "scenario": scenario,
        "seed": seed,
        "level": level,
        "relations": kind,
        "seconds": round(took, 4),
        "probability": found.probability,
        **counts,
    }


def right(row: dict[str, Any]) -> bool:
    return bool(row["contacts_missed"] == row["contacts_false"] == 0)


def table(rows: list[dict[str, Any]]) -> list[str]:
    """Both kinds at each level."""
    lines = [
        "| level | relations | all right | missed | false | seconds, median | longest |",
        "|---|---|---|---|---|---|---|",
    ]
    for level in LEVELS:
        for kind in KINDS:
            mine = [r for r in rows if (r["level"], r["relations"]) == (level, kind)]
            if mine:
                seconds = [r["seconds"] for r in mine]
                missed, false = (sum(r[f"contacts_{of}"] for r in mine) for of in ("missed", "false"))
                lines.append(
                    f"| {level:g} | `{kind}` | {sum(map(right, mine))} of {len(mine)} | {missed} | {false} | "
                    f"{np.median(seconds):.2f} | {max(seconds):.1f} |"
                )
    return lines


def by_scenario(rows: list[dict[str, Any]]) -> list[str]:
    """Sets that are right, one by one and together, scenarios down and levels across."""
    lines = [f"| all right: `{KINDS[0]}`, `{KINDS[1]}` | {' | '.join(f'level {level:g}' for level in LEVELS)} |"]
    lines.append("|---" * (len(LEVELS) + 1) + "|")
    for name in scenario_names():
        cells = []
        for level in LEVELS:
            here = [r for r in rows if (r["scenario"], r["level"]) == (name, level)]
            counts = [sum(right(r) for r in here if r["relations"] == kind) for kind in KINDS]
            cells.append(f"{counts[0]}, {counts[1]} of {len(here) // len(KINDS)}")
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return lines


def by_probability(rows: list[dict[str, Any]]) -> list[str]:
    """How often sets are right that say how likely they are."""
    lines = ["| said to be right with | sets | right | said, mean |", "|---|---|---|---|"]
    for low, high in pairwise(SURE):
        here = [r for r in rows if r["probability"] is not None and low <= r["probability"] < high]
        if here:
            share = np.mean([right(r) for r in here])
            mean = np.mean([r["probability"] for r in here])
            between = f"{100 * low:g} to {100 * min(high, 1.0):g} %"
            lines.append(f"| {between} | {len(here)} | {100 * share:.1f} % | {100 * mean:.1f} % |")
    return lines


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
