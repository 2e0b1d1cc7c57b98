"""Q1, Q2, Q3 and Q5: residual, drift and optimality of every draw, and the error along free directions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from apo_bench.geometry import Array
from benchmarks.corrector_bench.draws import draw
from benchmarks.corrector_bench.measures import Quality, quality
from benchmarks.corrector_bench.problems import FIGURES, Problem, problem
from benchmarks.corrector_bench.reference import optimum
from benchmarks.corrector_bench.rows import TrialRecord
from benchmarks.corrector_bench.runner import Ran, run

SMALL_NOISE = ("2/1", "5/3", "10/8")
LARGE = ("chain20", "grid4")


class Judged(NamedTuple):
    """Draws of one problem at one level by one peer."""

    ran: Ran
    quality: list[Quality]
    excess: Array
    """|z| / |z_ML| - 1 of every draw; NaN where no optimum is known."""


def judged(peer: str, of: Problem, noise_level: str, draws: int, per_part: bool = False, best: bool = True) -> Judged:
    """Solves and measures; a draw that was not finished counts as infinitely bad."""
    ran = run(peer, of.name, noise_level, draws, per_part=per_part, limit_s=120.0)
    lost = Quality(*[float("inf")] * len(Quality._fields))
    rated = []
    excess = []
    for seed in range(draws):
        given = draw(of, noise_level, seed, per_part)
        found = quality(of, given, ran.goals[seed]) if seed < len(ran.goals) else lost
        rated.append(found)
        excess.append(found.length / optimum(of, given).length - 1.0 if best else float("nan"))
    return Judged(ran, rated, np.array(excess))


def suite(draws: int, peer: str = "contact") -> list[TrialRecord]:
    """Figures with all draws, chains and grids with a tenth of them."""
    rows = []
    for name in (*FIGURES, *LARGE):
        of = problem(name)
        few = draws if name in FIGURES else max(2, draws // 20)
        for noise_level in (*SMALL_NOISE, "20/20"):
            if name in FIGURES or noise_level in SMALL_NOISE:
                rows += _rows(name, noise_level, judged(peer, of, noise_level, few), noise_level in SMALL_NOISE)
    for name in FIGURES:
        rows += _per_part(problem(name), draws, peer)
    return rows


def _rows(name: str, noise_level: str, found: Judged, small: bool) -> list[TrialRecord]:
    q = found.quality
    where = f"{name} {noise_level}"
    residual = np.array([each.residual_mm for each in q])
    drift = np.array([each.drift for each in q])
    known = found.excess[~np.isnan(found.excess)]
    bound = 1e-9 if name in FIGURES else 1e-6
    bad = np.array([each.overlong or not each.residual_mm <= bound for each in q])
    worst = {"draws": len(q), "ended": found.ran.ended}
    unknown = len(found.excess) - len(known)
    note = f"no optimum known of {unknown} draws" if unknown else ""
    return [
        TrialRecord("Q1", where, "largest residual, mm", residual.max(), f"<= {bound:g}" if small else "", "", worst),
        TrialRecord(
            "Q2",
            where,
            "largest drift, sigma",
            drift.max(),
            "<= 1e-6" if small else "",
            "",
            {"median": np.median(drift)},
        ),
        TrialRecord(
            "Q3", where, "largest |z|/|z_ML| - 1", max(known, default=np.nan), "<= 1e-6" if small else "", note
        ),
        TrialRecord("Q3", where, "share of bad draws", bad.mean(), "<= 0" if small else "<= 0.01"),
    ]


def _per_part(of: Problem, draws: int, peer: str) -> list[TrialRecord]:
    rows = []
    for who, target in ((peer, "<= 1.02"), ("newton", "")):
        found = judged(who, of, "2/1", draws, per_part=True, best=False).quality
        ours, seen = (np.array([getattr(q, f) for q in found]) for f in ("free_error", "seen_free_error"))
        ratio = np.sqrt(np.mean(ours**2) / np.mean(seen**2))
        fixed = np.sqrt(np.mean([q.fixed_error**2 for q in found]))
        detail = {"fixed_error": fixed, "position_mm": np.sqrt(np.mean([q.position_mm**2 for q in found]))}
        what = f"free error over that of the observation, per-part noise ({who})"
        rows.append(TrialRecord("Q5", of.name, what, ratio, target, "", detail))
    return rows
