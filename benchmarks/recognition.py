"""How many contacts are recognised? `python benchmarks/recognition.py [WORKERS [SEEDS [WIDE [TWICE]]]]` (some 10
minutes on two cores that have nothing else to do).

Every scenario, no robot. Each demonstration is simulated once and seen at every level. The first seeds (30) are shown
by careful and by careless humans, seen at all levels and recognised with both kinds of thresholds, the very first (10)
twice; the others, up to 100, are seen at the levels up to 0.5. Results are written after each seed, so the run may be
stopped: `benchmarks/results/recognition.csv` counts, `recognition.json` says which contacts were wrong,
`docs/pictures/recognition.png` draws, and the table in `docs/how/recognition.md` is written anew.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import json
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

from apo_bench.assembly import Assembly
from apo_bench.observation.noise import Level, make_noise
from apo_bench.records import RECOGNISED
from apo_bench.report.figures.levels import recognition_figure
from apo_bench.report.figures.sheet import draw
from apo_bench.report.tables.methods import recognition_table
from apo_bench.scenario.file import load_scenario, scenario_names
from apo_bench.simulation.scene.scene import Scene, build_scene
from apo_bench.statistics import ALL, Recognition, recognitions
from apo_bench.trial.recognised_contacts import count_contacts, recognise_by
from apo_bench.trial.stages import observe_demonstration, simulate_demonstration

LEVELS = (0.0, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0)
LOW = 0.5
"""The level up to which there are most seeds."""
HERE = Path(__file__).parent
RESULTS = HERE / "results"
DOCS = HERE.parent / "docs"
PAGE = DOCS / "how" / "recognition.md"
FIGURE = DOCS / "pictures" / "recognition.png"
BEGIN = "<!-- table: python benchmarks/recognition.py -->"
END = "<!-- end of table -->"


@cache
def scene(scenario: str) -> Scene:
    return build_scene(load_scenario(scenario))


def rows_of(scenario: str, seed: int, wide: int, twice: int) -> list[dict[str, Any]]:
    """One row for each carelessness, level and way of recognising, as far as a sweep's row says it."""
    made = []
    here = scene(scenario)
    levels = LEVELS if seed < wide else tuple(level for level in LEVELS if level <= LOW)
    kinds = RECOGNISED[: 1 + (seed < wide) + (seed < twice)]
    for careless in (0.0, 1.0) if here.scenario.careless is not None and seed < wide else (0.0,):
        shown = simulate_demonstration(here, careless, seed)
        for level, kind in product(levels, kinds) if shown.demonstration.code == "ok" else ():
            seen = observe_demonstration(shown, make_noise("isotropic", Level(level, level)), seed)
            told = recognise_by(seen, kind).assembly
            where = {"scenario": scenario, "noise": "isotropic", "eye": "noise", "relations": kind, "seed": seed}
            size = {"careless": careless, "level": level, "level_deg": level, "clearance_mm": here.clearance_mm}
            made.append(where | size | count_contacts(seen.assembly, told) | wrong(seen.assembly, told))
    return made


def wrong(right: Assembly, told: Assembly) -> dict[str, list[str]]:
    """The contacts that were missed and those that are false, with the number of their operation."""
    there, named = ({f"{r.made + 1}: {r.contact}" for r in of.relations()} for of in (right, told))
    return {"missed": sorted(there - named), "false": sorted(named - there)}


def main(workers: int = 2, seeds: int = 100, wide: int = 30, twice: int = 10) -> None:
    rows: list[dict[str, Any]] = []
    with ProcessPoolExecutor(workers) as pool:
        for seed in range(seeds):
            work = [pool.submit(rows_of, scenario, seed, wide, twice) for scenario in scenario_names()]
            rows += [row for unit in work for row in unit.result()]
            written(rows)
            print(f"seed {seed}: {len(rows)} observations", flush=True)
    print("\n".join(table(recognitions(rows))))


def written(rows: list[dict[str, Any]]) -> None:
    """Files, figure and page of what is known so far."""
    found = recognitions(rows)
    recognition_table(found).write(RESULTS / "recognition.csv")
    draw(recognition_figure(found)).write(FIGURE)
    wrongs = {
        f"{kind}, careless {careless:g}, level {level:g}": {
            what: Counter(f"{row['scenario']} {contact}" for row in rows if place(row) == (kind, careless, level)
                          for contact in row[what])
            for what in ("missed", "false")
        }
        for kind, careless, level in sorted({place(row) for row in rows})
    }  # fmt: skip
    form = json.dumps({"seeds": len({row["seed"] for row in rows}), "wrong": wrongs}, indent=1)
    (RESULTS / "recognition.json").write_text(form + "\n", encoding="utf-8")
    if PAGE.exists() and BEGIN in (text := PAGE.read_text(encoding="utf-8")):
        before, rest = text.split(BEGIN)
        middle = "\n".join(table(found))
        PAGE.write_text(f"{before}{BEGIN}\n\n{middle}\n\n{END}{rest.split(END, 1)[1]}", encoding="utf-8")


def place(row: dict[str, Any]) -> tuple[str, float, float]:
    return row["relations"], row["careless"], row["level"]


def table(found: tuple[Recognition, ...]) -> list[str]:
    """All scenarios over the levels, then each scenario with thresholds from the noise."""
    overall = [r for r in found if r.place.scenario == ALL]
    each = [
        r for r in found if r.place.scenario != ALL and r.place.relations == RECOGNISED[0] and r.place.careless == 0.0
    ]
    return [*recognition_table(overall).markdown(), "", *matrix(each)]


def matrix(found: list[Recognition]) -> list[str]:
    """Demonstrations all right, scenarios down and levels across."""
    levels = sorted({r.place.level for r in found})
    head = f"| `recognised`, careless 0: all right | {' | '.join(f'level {level:g}' for level in levels)} |"
    lines = [head, "|---" * (len(levels) + 1) + "|"]
    for name in dict.fromkeys(r.place.scenario for r in found):
        mine = {r.place.level: f"{r.complete} of {r.demonstrations}" for r in found if r.place.scenario == name}
        lines.append(f"| {name} | {' | '.join(mine.get(level, '') for level in levels)} |")
    return lines


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
