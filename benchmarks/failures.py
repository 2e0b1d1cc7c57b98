"""What correctors make of cameras that fail, no physics: `python -m benchmarks.failures [--draws N] [--kinds ...]`.

Right: fixed directions within the play, every contact covered, the plan foretold to fit. `told`: `contact-robust` that
is told which poses are false, so that these operations are inferred from contacts. `--stated 3` states three times the
rate of failures. `--out` keeps every draw, so that two versions can be compared in pairs; without it one line per kind
and corrector is all.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import time
from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import NDArray

from apo_bench import Assembly, Demonstration, Observation, draw_layout, load_scenario
from apo_bench.assembly import Plan, measured_rates, placements
from apo_bench.correction.correctors import correct
from apo_bench.geometry import Array, pose
from apo_bench.judging.contacts import face_overlap
from apo_bench.observation.looking import Looks
from apo_bench.observation.models.failures import RATE, AlongRay, CameraFailures, DisplacedView, Flipped, Stale, Swapped
from apo_bench.observation.noise import Level
from apo_bench.observation.observing import observe
from apo_bench.prediction.failure import predict
from apo_bench.scenario.scenario import Scenario
from apo_bench.trial.pose_error import goal_errors


@final
@dataclass(frozen=True, eq=False)
class Nearby(CameraFailures):
    """Parts are seen 5 to 15 mm off, in any direction."""

    def _seeming(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Array:
        goals = demonstration.goals.copy()
        for k in self._drawn(len(goals), rng):
            way = rng.standard_normal(3)
            goals[k, :3, 3] += way / np.linalg.norm(way) * rng.uniform(0.005, 0.015)
        return goals


@final
@dataclass(frozen=True, eq=False)
class Unnamed(CameraFailures):
    """What no hypothesis of the corrector names: parts are seen on another spot of the table, turned about a slant."""

    def _seeming(self, assembly: Assembly, demonstration: Demonstration, rng: np.random.Generator) -> Array:
        goals = demonstration.goals.copy()
        for k in self._drawn(len(goals), rng):
            axis = rng.standard_normal(3)
            turn = axis / np.linalg.norm(axis) * rng.uniform(np.radians(20.0), np.radians(70.0))
            goals[k, :2, 3] += rng.uniform(-0.1, 0.1, 2)
            goals[k] = goals[k] @ pose.exp(np.append(np.zeros(3), turn))
        return goals


SCENES = ("vanished_fixture", "stick_in_tower", "nested_bushings", "peg_in_hole", "gearbox")
KINDS: dict[str, tuple[type[CameraFailures], float]] = {
    "flips": (Flipped, 0.0),
    "flips-repeated": (Flipped, 0.8),
    "rays": (AlongRay, 0.0),
    "displaced-view": (DisplacedView, 0.0),
    "stale": (Stale, 0.0),
    "swaps": (Swapped, 0.0),
    "nearby": (Nearby, 0.0),
    "unnamed": (Unnamed, 0.0),
}
LEVEL = Level(1.0, 1.0)
CLEARANCE_MM = 0.25
"""The play, which is the largest error in fixed directions of a plan that is right, too."""


def right(scenario: Scenario, shown: Demonstration, goals: Array) -> bool:
    """Whether a plan with these goals, (n, 4, 4), is right."""
    assembly = shown.assembly
    if goal_errors(assembly, shown.start, shown.goals, goals)[0] > CLEARANCE_MM:
        return False
    for operation, poses in zip(assembly.operations, placements(assembly, shown.start, goals), strict=True):
        flat = (c for c in operation.contacts if all(face in assembly.solids[part].faces for part, face in c))
        if not all(face_overlap(assembly, contact, poses) for contact in flat):
            return False
    return not predict(Plan(assembly, shown.start, goals), CLEARANCE_MM, scenario.thresholds, scenario.attach).fails


def told(seen: Observation, false: NDArray[np.bool_]) -> Observation:
    """An observation in which what is false was not seen, and what was seen is believed."""
    return replace(seen, seen=seen.seen & ~false, outliers=measured_rates(0.0, 0.0))


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--draws", type=int, default=80, help="of each kind, over all scenes")
    asked.add_argument("--kinds", nargs="*", default=list(KINDS), choices=list(KINDS))
    asked.add_argument("--scenes", nargs="*", default=list(SCENES))
    asked.add_argument("--looks", nargs="*", type=int, default=[2, 4])
    asked.add_argument("--stated", type=float, default=1.0, help="the rate that is stated, over the one that is drawn")
    asked.add_argument("--out", type=Path, help="every draw, as JSON lines")
    asked.add_argument("--seconds", type=float, default=float("inf"), help="stop after so long")
    given = asked.parse_args()
    begun = time.monotonic()
    scenarios = [load_scenario(name) for name in given.scenes]
    ends = defaultdict[tuple[str, str], list[bool]](list)
    took = defaultdict[str, list[float]](list)
    kept = list[dict[str, object]]()
    for seed in range(given.draws):
        for kind in given.kinds:
            if time.monotonic() - begun > given.seconds:
                break
            scenario = scenarios[seed % len(scenarios)]
            model, repeat = KINDS[kind]
            noise = model(LEVEL, repeat=repeat)
            layout = draw_layout(scenario, np.random.default_rng([seed, 30, 0]), 0.0)
            n = len(layout.goals)
            shown = Demonstration(scenario.assembly, layout.start, layout.goals, layout.start, np.zeros((n, 6, 6)))
            seen = observe(shown, noise, np.random.default_rng([seed, 30, 1]))
            assert seen.outliers is not None
            seen = replace(seen, outliers=replace(seen.outliers, gross=min(0.49, RATE * given.stated)))
            false = noise.failures(scenario.assembly, shown, np.random.default_rng([seed, 30, 1])).false
            for name in ("told", "contact", "contact-robust", *(f"looks {k}" for k in given.looks)):
                look = None
                if name.startswith("looks"):
                    first = np.random.default_rng([seed, 30, 1])
                    look = Looks(shown, noise, np.random.default_rng([seed, 30, 2]), int(name[5:]), first=first)
                method = "contact" if name == "contact" else "contact-robust"
                since = time.process_time()
                made = correct(told(seen, false) if name == "told" else seen, method, look)
                seconds = time.process_time() - since
                took[name].append(seconds)
                ends[kind, name].append(made.ok and right(scenario, shown, made.goals))
                kept.append(
                    {
                        "seed": seed,
                        "kind": kind,
                        "corrector": name,
                        "right": ends[kind, name][-1],
                        "status": made.status,
                        "false": [int(k) for k in np.flatnonzero(false)],
                        "left_out": made.left_out,
                        "dropped": made.dropped,
                        "weight": made.hypotheses[0].weight if made.hypotheses else None,
                        "seconds": round(seconds, 4),
                    }
                )
    for (kind, name), each in ends.items():
        print(f"{kind:16} {name:16} {sum(each)} of {len(each)} right")
    for name, seconds in took.items():
        p50, p95 = np.percentile(seconds, [50, 95])
        print(f"{name:16} {p50:.2f} s p50, {p95:.2f} s p95, processor time")
    if given.out is not None:
        given.out.write_text("".join(json.dumps(one) + "\n" for one in kept), encoding="utf-8")


if __name__ == "__main__":
    main()
