"""Q4: is the rank right, and do the free directions that are reported span those of the geometry?"""

from __future__ import annotations

from benchmarks.corrector_bench.draws import draw
from benchmarks.corrector_bench.measures import alike, free_basis
from benchmarks.corrector_bench.own import corrected, observation, reported
from benchmarks.corrector_bench.problems import FIGURES, problem
from benchmarks.corrector_bench.rows import Row

ALIKE = 1e-6
"""Sine of the largest angle between the reported and the true free directions."""


def suite(draws: int) -> list[Row]:
    rows = []
    for name in (*FIGURES, "chain20", "grid4"):
        of = problem(name)
        few = draws if name in FIGURES else max(2, draws // 20)
        for level in ("2/1", "5/3", "10/8"):
            right, widest = 0, 0.0
            for seed in range(few):
                given = draw(of, level, seed)
                rank, free = reported(of, given)
                made = corrected(observation(of, given), "contact")
                angle = alike(free, free_basis(of, given, made.goals))
                right += rank == of.rank == made.rank and angle <= ALIKE
                widest = max(widest, angle)
            detail = {"draws": few, "rank": of.rank, "largest angle": widest}
            rows.append(
                Row("Q4", f"{name} {level}", "rank and freedom right, %", 100 * right / few, ">= 100", "", detail)
            )
    return rows
