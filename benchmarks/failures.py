"""What `contact-robust` makes of cameras that fail, no physics: `python -m benchmarks.failures FILE [--draws N]`.

Right: fixed directions within the play, every contact covered, the plan foretold to fit. `told`, the ceiling:
`contact-robust` that is told which poses are false, so that these operations are inferred from contacts. Rates of
failures are stated rightly, three times too low, and three times too high; then a third as many fail. Every draw is a
line of FILE, and what is there is not made again. Writes results/failures.csv and its part of docs/results/robust.md.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import time
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from apo_bench import Demonstration, Observation, draw_layout, load_scenario
from apo_bench.assembly import Plan, measured_rates, placements
from apo_bench.correction.correctors import correct
from apo_bench.geometry import Array, pose
from apo_bench.judging.contacts import face_overlap
from apo_bench.perception.observation.models import Camera
from apo_bench.perception.observation.models.failures import PRESETS, RATE, CameraFailures, Failure, draw_failing
from apo_bench.perception.observation.noise import NoiseLevel
from apo_bench.perception.observation.observing import observe
from apo_bench.perception.observation.reobservations import Reobservations
from apo_bench.planning.prediction.failure import predict
from apo_bench.scenario.scenario import Scenario
from apo_bench.trial.outcome_columns import goal_errors
from benchmarks.failures_page import write


def see_nearby(goals: Array, shown: Demonstration, camera: Camera, rate: float, rng: np.random.Generator) -> None:
    """Parts are seen 5 to 15 mm off, in any direction."""
    for k in draw_failing(len(goals), rate, rng):
        way = rng.standard_normal(3)
        goals[k, :3, 3] += way / np.linalg.norm(way) * rng.uniform(0.005, 0.015)


def see_elsewhere(goals: Array, shown: Demonstration, camera: Camera, rate: float, rng: np.random.Generator) -> None:
    """What no hypothesis of the corrector names: parts are seen on another spot of the table, turned about a slant."""
    for k in draw_failing(len(goals), rate, rng):
        axis = rng.standard_normal(3)
        turn = axis / np.linalg.norm(axis) * rng.uniform(np.radians(20.0), np.radians(70.0))
        goals[k, :2, 3] += rng.uniform(-0.1, 0.1, 2)
        goals[k] = goals[k] @ pose.exp(np.append(np.zeros(3), turn))


SCENES = ("vanished_fixture", "stick_in_tower", "nested_bushings", "peg_in_hole", "gearbox")
KINDS: dict[str, tuple[Failure, float]] = {
    "flips": (PRESETS["flips"], 0.0),
    "flips-repeated": (PRESETS["flips"], 0.8),
    "rays": (PRESETS["rays"], 0.0),
    "displaced-view": (PRESETS["displaced-view"], 0.0),
    "stale": (PRESETS["stale"], 0.0),
    "swaps": (PRESETS["swaps"], 0.0),
    "nearby": (Failure(see_nearby, "parts are seen 5 to 15 mm off", "S = T shifted"), 0.0),
    "unnamed": (Failure(see_elsewhere, "parts are seen elsewhere", "S anywhere"), 0.0),
}
NOISE_LEVEL = NoiseLevel(1.0, 1.0)
CLEARANCE_MM = 0.25
"""The play, which is the largest error in fixed directions of a plan that is right, too."""


def right(scenario: Scenario, shown: Demonstration, goals: Array) -> bool:
    """Whether a plan with these goals, (n, 4, 4), is right."""
    assembly = shown.assembly
    if goal_errors(assembly, shown.start, shown.poses, goals)[0] > CLEARANCE_MM:
        return False
    for operation, poses in zip(assembly.operations, placements(assembly, shown.start, goals), strict=True):
        flat = (c for c in operation.contacts if all(face in assembly.solids[part].faces for part, face in c))
        if not all(face_overlap(assembly, contact, poses) for contact in flat):
            return False
    return not predict(Plan(assembly, shown.start, goals), CLEARANCE_MM, scenario.thresholds, scenario.attach).fails


def told(seen: Observation, false: NDArray[np.bool_]) -> Observation:
    """An observation in which what is false was not seen, and what was seen is believed."""
    return replace(seen, observed=seen.observed & ~false, outliers=measured_rates(0.0, 0.0))


STATED: dict[float, tuple[float, float]] = {1.0: (RATE, RATE), 1 / 3: (RATE, RATE / 3), 3.0: (RATE / 3, RATE)}
"""How many times the rate of failures is stated: the rate, and what is stated."""
CORRECTORS = ("told", "contact-robust", "looks 2")
REOBSERVE = 2


@final
@dataclass(frozen=True)
class Draw:
    """One observation."""

    seed: int
    kind: str
    stated: float

    @property
    def scene(self) -> str:
        return SCENES[self.seed % len(SCENES)]


def drawn(draw: Draw) -> tuple[Demonstration, CameraFailures, Observation, NDArray[np.bool_]]:
    """The truth, the camera, what it sees and is said of it, and which operations are false, (n,)."""
    scenario = load_scenario(draw.scene)
    failure, repeat = KINDS[draw.kind]
    rate, stated = STATED[draw.stated]
    noise = CameraFailures(NOISE_LEVEL, (failure._replace(rate=rate),), repeat)
    layout = draw_layout(scenario, np.random.default_rng([draw.seed, 30, 0]), 0.0)
    n = len(layout.poses)
    shown = Demonstration(scenario.assembly, layout.start, layout.poses, layout.start, np.zeros((n, 6, 6)))
    seen = observe(shown, noise, np.random.default_rng([draw.seed, 30, 1]))
    assert seen.outliers is not None
    false = noise.draw_false(shown, np.random.default_rng([draw.seed, 30, 1])).false
    return shown, noise, replace(seen, outliers=replace(seen.outliers, gross=stated)), false


def corrected(draw: Draw) -> dict[str, object]:
    """What each corrector makes of a draw: right or not, seconds of processor time, what is said."""
    scenario = load_scenario(draw.scene)
    shown, noise, seen, false = drawn(draw)
    first = np.random.default_rng([draw.seed, 30, 1])
    max_reobservations = Reobservations(shown, noise, np.random.default_rng([draw.seed, 30, 2]), REOBSERVE, first=first)
    ends = dict[str, bool]()
    seconds = dict[str, float]()
    sentence = ""
    for name in CORRECTORS:
        since = time.process_time()
        given = told(seen, false) if name == "told" else seen
        made = correct(given, "contact-robust", max_reobservations if name.startswith("max_reobservations") else None)
        seconds[name] = round(time.process_time() - since, 4)
        ends[name] = made.ok and right(scenario, shown, made.poses)
        sentence = made.sentence if name == "contact-robust" else sentence
    false_ones = [int(k) + 1 for k in np.flatnonzero(false)]
    return asdict(draw) | {
        "scene": draw.scene,
        "false": false_ones,
        "right": ends,
        "seconds": seconds,
        "sentence": sentence,
    }


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("file", type=Path, help="draws as JSON lines, made longer")
    asked.add_argument("--draws", type=int, default=400, help="of each kind and stated rate, over all scenes")
    asked.add_argument("--kinds", nargs="*", default=list(KINDS), choices=list(KINDS))
    asked.add_argument("--seconds", type=float, default=float("inf"), help="stop after so long")
    given = asked.parse_args()
    begun = time.monotonic()
    known = {(one["seed"], one["kind"], one["stated"]) for one in read(given.file)}
    wanted = (Draw(*each) for each in product(range(given.draws), given.kinds, STATED))
    with given.file.open("a", encoding="utf-8") as file:
        for draw in wanted:
            if time.monotonic() - begun > given.seconds:
                break
            if (draw.seed, draw.kind, draw.stated) not in known:
                print(json.dumps(corrected(draw)), file=file, flush=True)
    write(read(given.file))


def read(file: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()] if file.exists() else []


if __name__ == "__main__":
    main()
