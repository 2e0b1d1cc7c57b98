"""What `contact-robust` costs beside `contact`: `python benchmarks/robust_times.py [--draws N]` (two minutes).

Static draws of the four tasks of the paper with 1 mm and 1 degree, without outliers and with those of `gross.toml`, and
of a row of castles and sticks, ten operations of which three were seen anywhere. Both correct the same observation in
turn, processor time, one thread; the first four draws of each case are not counted. Writes `results/robust_times.json`.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

sys.path.pop(0)  # this folder, whose coverage.py Numba takes for another
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from apo_bench.assembly import Demonstration, Observation
from apo_bench.correction.correctors import correct
from apo_bench.geometry import pose
from apo_bench.observation.noise import Level, make_noise
from apo_bench.scenario.file import load_scenario
from apo_bench.scenario.layout import draw_layout
from benchmarks.corrector_bench.problems import lined_up

HERE = Path(__file__).resolve().parent
TASKS = ("stick_in_tower", "carried_bridge", "vanished_fixture", "pocket_table")
OPERATIONS = 10
OUTLIERS = 3
PLAY_M = 0.25e-3
SEED = 17


def tasks(noise: str, draws: int) -> Iterator[Observation]:
    """Every task in turn, seen by a noise model."""
    scenarios = [load_scenario(name) for name in TASKS]
    for i in range(draws + 1):
        for t, scenario in enumerate(scenarios):
            rng = np.random.default_rng([SEED, i, t])
            layout = draw_layout(scenario, rng, 0.0)
            none = np.zeros((len(scenario.assembly), 6, 6))
            shown = Demonstration(scenario.assembly, layout.start, layout.goals, layout.start, none, play_m=PLAY_M)
            yield make_noise(noise, Level(1.0, 1.0))(scenario.assembly, shown, rng)


def row(draws: int) -> Iterator[Observation]:
    """Six castles in a row and four sticks in their slots; three operations seen anywhere, turned anyhow."""
    whole, truth = lined_up(6)
    assembly = replace(whole, operations=whole.operations[:OPERATIONS])
    start = {part: pose.at([0.4 * i, -1.0, 0.0]) for i, part in enumerate(assembly.solids)} | {"table": np.eye(4)}
    sigma = np.repeat([1e-3, np.radians(1.0)], 3)
    covariance = np.tile(np.diag(sigma**2), (OPERATIONS, 1, 1))
    seen = np.ones(OPERATIONS, dtype=np.bool_)
    for i in range(4 * (draws + 1)):
        rng = np.random.default_rng([SEED, i])
        goals = truth[:OPERATIONS] @ pose.exp(sigma * rng.standard_normal((OPERATIONS, 6)))
        for k in rng.choice(OPERATIONS, OUTLIERS, replace=False):
            goals[k] = goals[k] @ pose.unpack(np.concatenate([rng.uniform(-0.5, 0.5, 3), rng.standard_normal(4)]))
        yield Observation(assembly, start, goals, covariance, seen, play_m=PLAY_M)


def measured(observations: Iterator[Observation]) -> dict[str, float]:
    """Medians and 95th percentiles, [ms], and the median of the ratio."""
    ms = np.array([[_ms(one, name) for name in ("contact", "contact-robust")] for one in observations])[4:]
    (plain, robust), (_, slow) = np.percentile(ms, [50, 95], axis=0)
    found = {"median ratio": np.median(ms[:, 1] / ms[:, 0]), "contact ms": plain, "robust ms": robust, "p95 ms": slow}
    return {"draws": len(ms), **{name: round(float(x), 2) for name, x in found.items()}}


def _ms(observation: Observation, name: str) -> float:
    before = time.process_time()
    correct(observation, name)
    return 1e3 * (time.process_time() - before)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--draws", type=int, default=25, help="draws of each task; four times as many of the row (25)")
    draws = parser.parse_args().draws
    cases = {
        "four tasks, no outliers": tasks("isotropic", draws),
        "four tasks, 24 % gross": tasks(str(HERE / "gross.toml"), draws),
        "ten operations, three outliers": row(draws),
    }
    found = {name: measured(observations) for name, observations in cases.items()}
    print(json.dumps(found, indent=1))
    (HERE / "results" / "robust_times.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
