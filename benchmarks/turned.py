"""What do correctors make of a part that was seen turned? `python benchmarks/turned.py [--draws N] [--only NAME,..]`
(a quarter of an hour on a quiet core for the 10,000 draws that are the default).

Every draw takes the next scenario and, all of these done, the next corrector. A layout is drawn and its consistent
goals are seen with 1 mm and 1 degree of noise; one operation, drawn too, is turned by 90, 135 or 180 degrees about the
x, y or z axis of its part or one that looks anywhere. What a corrector calls `converged` is looked at in the world: do
the faces of every contact that it kept look at each other when the contact is made?

`results/turned.json` counts, written anew every 100 draws; the table in `docs/how/contact.md` is written anew at the
end. The exit code is 1 if a corrector called goals right at which faces look the same way.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from functools import cache
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from apo_bench.assembly import Assembly, Correction, Demonstration, Layout, Observation, placements
from apo_bench.correction.correctors import correct
from apo_bench.geometry import all_boxes, pose
from apo_bench.observation.noise import Level, make_noise
from apo_bench.scenario.file import load_scenario, scenario_names
from apo_bench.scenario.layout import draw_layout
from apo_bench.scenario.scenario import Scenario
from apo_bench.trial.outcome_columns import goal_errors

OURS = (
    "contact",
    "contact-refuse",
    "contact-drop",
    "contact-robust",
    "paper",
    "paper-track",
    "last-only",
    "minimal",
    "no-history",
    "no-disappeared",
    "snap",
    "least-squares",
    "penalty",
)
TURNS = (90.0, 135.0, 180.0)
SEED = 16
LEVEL = 1.0
RIGHT_MM = 0.35
"""Root mean square error along fixed directions up to which goals are right."""
OPPOSING = -0.9
"""Cosine between the normals of two faces that look at each other, at most."""
HERE = Path(__file__).parent
RESULTS = HERE / "results" / "turned.json"
PAGE = HERE.parent / "docs" / "how" / "contact.md"
BEGIN = "<!-- table: python benchmarks/turned.py -->"
END = "<!-- end of table -->"


def turned(scenario: Scenario, rng: np.random.Generator) -> tuple[Layout, Observation]:
    """A layout, and what was seen of it with one operation turned."""
    layout = draw_layout(scenario, rng)
    n = len(scenario.assembly)
    human = Demonstration(scenario.assembly, layout.start, layout.goals, layout.start, np.zeros((n, 6, 6)))
    seen = make_noise("isotropic", Level(LEVEL, LEVEL))(scenario.assembly, human, rng)
    axis = rng.standard_normal(3) if (a := int(rng.integers(4))) == 3 else np.eye(3)[a]
    way = np.radians(rng.choice(TURNS)) * axis / np.linalg.norm(axis)
    goals = np.array(seen.goals)
    k = int(rng.integers(n))
    goals[k] = goals[k] @ pose.exp(np.concatenate([np.zeros(3), way]))
    return layout, Observation(scenario.assembly, layout.start, goals, seen.covariance, seen.seen)


def faces_oppose(assembly: Assembly, layout: Layout, made: Correction) -> bool:
    """Whether the faces of every contact that was kept look at each other, in the world, when it is made."""
    kept = iter(assembly.without(made.dropped))
    for operation, at in zip(assembly.operations, placements(assembly, layout.start, made.goals), strict=True):
        for contact in operation.contacts:
            a, b = (at[of.part][:3, :3] @ assembly.face(of).normal for of in contact)
            if next(kept) and a @ b > OPPOSING:
                return False
    return True


def of_boxes() -> tuple[str, ...]:
    """The scenarios whose parts are boxes: whether faces look at each other is asked of flat ones."""
    parts = {name: scenario_of(name).assembly.solids.values() for name in scenario_names()}
    return tuple(name for name, solids in parts.items() if all(all_boxes(solid.pieces) for solid in solids))


@cache
def scenario_of(name: str) -> Scenario:
    return load_scenario(name)


def count(draws: int, correctors: tuple[str, ...]) -> dict[str, dict[str, int]]:
    """Draws, what converged, what of that is right, and what looks the same way, of each corrector."""
    found = {name: dict.fromkeys(("draws", "converged", "right", "same way"), 0) for name in correctors}
    names = of_boxes()
    for i in range(draws):
        scenario = scenario_of(names[i % len(names)])
        name = correctors[i // len(names) % len(correctors)]
        layout, seen = turned(scenario, np.random.default_rng([SEED, i]))
        made = correct(seen, name)
        row = found[name]
        row["draws"] += 1
        if made.ok:
            row["converged"] += 1
            row["right"] += goal_errors(seen.assembly, layout.start, layout.goals, made.goals)[0] <= RIGHT_MM
            row["same way"] += not faces_oppose(seen.assembly, layout, made)
        if (i + 1) % 100 == 0 or i + 1 == draws:
            form: dict[str, Any] = {"seed": SEED, "draws": i + 1, "correctors": found}
            RESULTS.write_text(json.dumps(form, indent=1) + "\n", encoding="utf-8")
    return found


def table(found: dict[str, dict[str, int]]) -> str:
    """Markdown."""
    rows = [f"| `{name}` | " + " | ".join(map(str, row.values())) + " |" for name, row in found.items()]
    return "\n".join(
        ["| corrector | draws | converged | right | faces look the same way |", "|---|---|---|---|---|", *rows]
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--draws", type=int, default=10_000)
    parser.add_argument("--only", default=",".join(OURS), help="names of correctors")
    given = parser.parse_args()
    found = count(given.draws, tuple(given.only.split(",")))
    print(table(found))
    if tuple(found) == OURS and BEGIN in (text := PAGE.read_text(encoding="utf-8")):
        before, rest = text.split(BEGIN)
        PAGE.write_text(f"{before}{BEGIN}\n\n{table(found)}\n\n{END}{rest.split(END, 1)[1]}", encoding="utf-8")
    return int(any(row["same way"] for row in found.values()))


if __name__ == "__main__":
    sys.exit(main())
