"""False alarms of the test (Q6) and coverage of the posterior: what the corrector says of itself, against the truth."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

from apo_bench.correction.region import contains_truth
from apo_bench.geometry import Array
from benchmarks.corrector_bench.draws import Draw, draw, factors
from benchmarks.corrector_bench.measures import free_basis, lengths, spread
from benchmarks.corrector_bench.own import corrected, observation
from benchmarks.corrector_bench.problems import FIGURES, Problem, problem
from benchmarks.corrector_bench.rows import TrialRecord

NOISE_LEVEL = 0.01
REGION = 0.95
FIRST = 10_000
"""Seeds of their own."""


def suite(draws: int) -> list[TrialRecord]:
    """Ten times as many draws as elsewhere at 2 mm and 1 degree and with noise that differs from part to part."""
    rows = []
    for name in FIGURES:
        for per_part in (False, True):
            rows += _rows(name, per_part, 10 * draws)
    return rows


def _rows(name: str, per_part: bool, draws: int) -> list[TrialRecord]:
    of = problem(name)
    where = f"{name} 2/1{', per part' if per_part else ''}"
    bound = chdtri(6 * of.n - of.rank, 1.0 - REGION)
    alarms = 0
    said = 0
    found = 0
    fixed_mm = []
    refused = 0
    for seed in range(FIRST, FIRST + draws):
        given = draw(of, "2/1", seed, per_part)
        seen = observation(of, given)
        made = corrected(seen)
        refused += not made.ok
        alarms += made.test is None or made.test.p_value < NOISE_LEVEL
        said += bool(contains_truth(seen, made, given.truth, REGION))
        found += spread(of, given, made.poses) <= bound
        fixed_mm.append(1e3 * _across_m(of, given, made.poses))
    share = 100.0 / draws
    detail = {"draws": draws, "by geometry": found * share, "not converged": refused}
    rows = [
        TrialRecord("Q6", where, "false alarms at 1 %, %", alarms * share, "0.4 .. 1.6", "", {"draws": draws}),
        TrialRecord("coverage", where, "95 % regions that hold the truth, %", said * share, "93.5 .. 96.5", "", detail),
    ]
    what = "error across the free directions, rms, mm"
    return [*rows, TrialRecord("coverage", where, what, float(np.sqrt(np.mean(np.square(fixed_mm)))))]


def _across_m(of: Problem, given: Draw, goals: Array) -> float:
    """Distance from the truth across the free directions, root mean square over parts: what curvature leaves."""
    Q = free_basis(of, given, goals)
    L = factors(given.covariance)
    off = lengths(given, given.truth) - lengths(given, goals)
    twist = L @ (off - Q @ (Q.T @ off)).reshape(-1, 6, 1)
    return float(np.sqrt(np.mean(np.sum(twist[:, :3, 0] ** 2, axis=1))))
