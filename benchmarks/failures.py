"""What correctors make of cameras that fail, no physics: `python -m benchmarks.failures [--draws N] [--kinds ...]`.

Right: fixed directions within 0.5 mm, every contact covered, the plan foretold to fit. `told`: `contact-robust` that is
told which poses are false, so that these operations are inferred from contacts. Prints one line per kind and corrector.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import time
from collections import defaultdict
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from apo_bench import Demonstration, Observation, draw_layout, load_scenario
from apo_bench.assembly import Plan, measured_rates, placements
from apo_bench.correction.correctors import correct
from apo_bench.geometry import Array
from apo_bench.judging.contacts import face_overlap
from apo_bench.observation.looking import Looks
from apo_bench.observation.models.failures import AlongRay, CameraFailures, DisplacedView, Flipped, Stale, Swapped
from apo_bench.observation.noise import Level
from apo_bench.observation.observing import observe
from apo_bench.prediction.failure import predict
from apo_bench.scenario.scenario import Scenario
from apo_bench.trial.pose_error import goal_errors

SCENES = ("vanished_fixture", "stick_in_tower", "nested_bushings", "peg_in_hole", "gearbox")
KINDS: dict[str, tuple[type[CameraFailures], float]] = {
    "flips": (Flipped, 0.0),
    "flips-repeated": (Flipped, 0.8),
    "rays": (AlongRay, 0.0),
    "displaced-view": (DisplacedView, 0.0),
    "stale": (Stale, 0.0),
    "swaps": (Swapped, 0.0),
}
LEVEL = Level(1.0, 1.0)
CLEARANCE_MM = 0.25
WITHIN_MM = 0.5
"""Largest error in fixed directions of a plan that is right."""


def right(scenario: Scenario, shown: Demonstration, goals: Array) -> bool:
    """Whether a plan with these goals, (n, 4, 4), is right."""
    assembly = shown.assembly
    if goal_errors(assembly, shown.start, shown.goals, goals)[0] > WITHIN_MM:
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
    asked.add_argument("--seconds", type=float, default=float("inf"), help="stop after so long")
    given = asked.parse_args()
    begun = time.monotonic()
    scenarios = [load_scenario(name) for name in given.scenes]
    ends = defaultdict[tuple[str, str], list[bool]](list)
    took = defaultdict[str, list[float]](list)
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
            false = noise.failures(scenario.assembly, shown, np.random.default_rng([seed, 30, 1])).false
            for name in ("told", "contact", "contact-robust", *(f"looks {k}" for k in given.looks)):
                look = None
                if name.startswith("looks"):
                    first = np.random.default_rng([seed, 30, 1])
                    look = Looks(shown, noise, np.random.default_rng([seed, 30, 2]), int(name[5:]), first=first)
                method = "contact" if name == "contact" else "contact-robust"
                since = time.perf_counter()
                made = correct(told(seen, false) if name == "told" else seen, method, look)
                took[name].append(time.perf_counter() - since)
                ends[kind, name].append(made.ok and right(scenario, shown, made.goals))
    for (kind, name), each in ends.items():
        print(f"{kind:16} {name:16} {sum(each)} of {len(each)} right")
    for name, seconds in took.items():
        p50, p95 = np.percentile(seconds, [50, 95])
        print(f"{name:16} {p50:.2f} s p50, {p95:.2f} s p95")


if __name__ == "__main__":
    main()
