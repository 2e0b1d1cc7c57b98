"""Q4: is the rank right, and does the posterior leave free what the geometry leaves free, and nothing else?"""

from __future__ import annotations

from benchmarks.corrector_bench.draws import draw
from benchmarks.corrector_bench.measures import freedom_error
from benchmarks.corrector_bench.own import corrected, observation
from benchmarks.corrector_bench.problems import FIGURES, problem
from benchmarks.corrector_bench.rows import TrialRecord

ALIKE = 1e-6
"""Largest difference of stated and true posterior, as a part of the variance of the noise."""


def suite(draws: int) -> list[TrialRecord]:
    """Figures with all draws; a chain and a grid with a twentieth of them."""
    rows = []
    for name in (*FIGURES, "chain20", "grid4"):
        for noise_level in ("2/1", "5/3", "10/8"):
            rows.append(_row(name, noise_level, draws if name in FIGURES else max(2, draws // 20)))
    return rows


def _row(name: str, noise_level: str, draws: int) -> TrialRecord:
    of = problem(name)
    right = 0
    widest = 0.0
    ranks = 0
    for seed in range(draws):
        given = draw(of, noise_level, seed)
        made = corrected(observation(of, given))
        off = float("inf")
        if made.covariance is not None:
            off = freedom_error(of, given, made.poses, made.covariance)
        ranks += made.rank == of.rank
        right += made.rank == of.rank and off <= ALIKE
        widest = max(widest, off)
    detail = {"draws": draws, "rank": of.rank, "rank right": ranks / draws, "largest difference": widest}
    what = "rank and freedom right, %"
    return TrialRecord("Q4", f"{name} {noise_level}", what, 100 * right / draws, ">= 100", "", detail)
