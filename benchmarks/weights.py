"""Do the weights of hypotheses hold? `python -m benchmarks.weights [--draws N] [--seconds S]`: the temperature too.

Cameras fail in every way that has a name, and in one that has none, in scenes that `benchmarks.failures` does not look
at. A hypothesis is right if its goals are, within the play along what contacts fix. Of half the seeds it finds the
temperature at which the weight of the right hypotheses is likeliest, and how often none is right; of the other half it
prints how often the first is right beside how likely it was said to be.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import time
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from apo_bench import Demonstration, draw_layout, load_scenario
from apo_bench.correction.correctors import correct
from apo_bench.correction.robust.robust import TEMPERATURE, UNNAMED, RobustCorrector
from apo_bench.geometry import Array
from apo_bench.observation.looking import observe
from apo_bench.trial.outcome_columns import goal_errors
from benchmarks.failures import CLEARANCE_MM, KINDS, LEVEL

SCENES = ("carried_bridge", "pocket_table", "fixture_alignment", "shaft_through_brackets")
TEMPERATURES = np.geomspace(1.0, 30.0, 60)
BINS = (0.0, 0.5, 0.7, 0.9, 0.96, 1.0)
_WARM = 5.0
"""The temperature at which hypotheses are kept: few are left out."""
_LEAST = 1e-12


class Case(NamedTuple):
    """One observation in which something was doubted."""

    seed: int
    gaps: Array
    """(h,): -2 log of how likely each hypothesis is beside the first."""
    right: Array
    """(h,): whether its goals are right."""


def weights(gaps: Array, temperature: float) -> Array:
    """Of hypotheses at a temperature, (h,)."""
    w = np.exp(-0.5 / temperature * gaps)
    return np.asarray(w / w.sum())


def surprise(cases: Sequence[Case], temperature: float) -> float:
    """Mean -log of the weight of what is right; cases in which nothing is do not tell one temperature from another."""
    told = [case for case in cases if case.right.any()]
    return float(np.mean([-np.log(max(_LEAST, weights(c.gaps, temperature)[c.right].sum())) for c in told]))


def drawn(draws: int, seconds: float) -> list[Case]:
    scenarios = [load_scenario(name) for name in SCENES]
    corrector = RobustCorrector(temperature=_WARM)
    begun = time.monotonic()
    cases = list[Case]()
    for seed in range(draws):
        scenario = scenarios[seed % len(scenarios)]
        for kind, (model, repeat) in KINDS.items():
            if repeat or kind == "nearby" or time.monotonic() - begun > seconds:
                continue
            layout = draw_layout(scenario, np.random.default_rng([seed, 31, 0]), 0.0)
            n = len(layout.goals)
            shown = Demonstration(scenario.assembly, layout.start, layout.goals, layout.start, np.zeros((n, 6, 6)))
            seen = observe(shown, model(LEVEL), np.random.default_rng([seed, 31, 1, *kind.encode()]))
            made = correct(seen, corrector)
            if not made.hypotheses:
                continue
            w = np.array([one.weight for one in made.hypotheses])
            right = [
                goal_errors(scenario.assembly, layout.start, layout.goals, one.goals)[0] <= CLEARANCE_MM
                for one in made.hypotheses
            ]
            cases.append(Case(seed, -2.0 * _WARM * np.log(w / w[0]), np.array(right)))
    return cases


def lines(cases: Sequence[Case], temperature: float, unnamed: float) -> list[str]:
    """How often the first hypothesis is right beside what is said of it."""
    said = np.array([(1.0 - unnamed) * weights(case.gaps, temperature)[0] for case in cases])
    right = np.array([case.right[0] for case in cases])
    found = []
    for low, high in pairwise(BINS):
        some = (said >= low) & ((said < high) | (high == 1.0))
        if some.any():
            found.append(f"  said {100 * said[some].mean():5.1f} %: right {right[some].sum()} of {some.sum()}")
    return found


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--draws", type=int, default=200, help="seeds; each kind once in each")
    asked.add_argument("--seconds", type=float, default=float("inf"), help="stop after so long")
    given = asked.parse_args()
    cases = drawn(given.draws, given.seconds)
    learned = [case for case in cases if case.seed // len(SCENES) % 2 == 0]
    kept = [case for case in cases if case.seed // len(SCENES) % 2]
    best = min(TEMPERATURES, key=lambda t: surprise(learned, t))
    none = np.mean([not case.right.any() for case in learned])
    print(f"{len(cases)} observations with a doubt; of {len(learned)}, the first half:")
    print(f"temperature {best:.2f}, none is right in {100 * none:.1f} %; here {TEMPERATURE:g} and {100 * UNNAMED:g} %")
    for temperature in (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0):
        each = (f"{surprise(some, temperature):.4f}" for some in (learned, kept))
        print(f"at {temperature:.1f}: mean -log {', '.join(each)}")
    missing = sum(not case.right.any() for case in kept)
    print(f"{len(kept)} others, none is right in {missing}; with temperature and share of this corrector:")
    print("\n".join(lines(kept, TEMPERATURE, UNNAMED)))


if __name__ == "__main__":
    main()
