"""Q8: the compiled corrector gives the goals of the one that is not compiled, in every scenario of the package."""

from __future__ import annotations

import numpy as np

import apo_bench
from apo_bench.assembly import Observation
from apo_bench.geometry import pose
from apo_bench.scenario.scenario import Scenario
from benchmarks.corrector_bench.draws import LEVELS
from benchmarks.corrector_bench.rows import TrialRecord

SCENARIOS = (
    *("block_on_block", "bridge_cycle", "carried_bridge", "fixture_alignment"),
    *("pocket_table", "stick_in_tower", "stick_on_castles", "vanished_fixture"),
)
PLAYS_M = (0.0, 0.25e-3)
FIRST = 30_000


def suite(draws: int) -> list[TrialRecord]:
    """A quarter of the draws of every scenario at each level and play."""
    return [_row(noise_level, max(3, draws // 4)) for noise_level in ("2/1", "5/3", "10/8")]


def _row(noise_level: str, draws: int) -> TrialRecord:
    plain = apo_bench.ContactCorrector(compiled=False)
    off = 0.0
    otherwise = 0
    count = 0
    for of in map(apo_bench.load_scenario, SCENARIOS):
        for seed in range(FIRST, FIRST + draws):
            seen = _drawn(of, noise_level, seed)
            a = apo_bench.correct(seen, plain)
            b = apo_bench.correct(seen, "contact")
            otherwise += (a.status, a.rank, a.sentence, a.dropped) != (b.status, b.rank, b.sentence, b.dropped)
            off = max(off, 1e3 * float(np.abs(a.poses - b.poses).max()))
            count = count + 1
    what = "goals compiled against not compiled, all scenarios, mm"
    return TrialRecord(
        "Q8", noise_level, what, off, "<= 1e-9", "", {"draws": count, "other status, rank or sentence": otherwise}
    )


def _drawn(of: Scenario, noise_level: str, seed: int) -> Observation:
    """Noise of a covariance of its own for every operation, not diagonal; parts that fit with and without play."""
    rng = np.random.default_rng([seed, 4])
    mm, degrees = LEVELS[noise_level]
    n = len(of.assembly)
    sigma = np.repeat([1e-3 * mm, np.radians(degrees)], 3) * rng.uniform(0.5, 1.5, size=(n, 1))
    L = sigma[:, :, None] * (np.tril(rng.normal(scale=0.2, size=(n, 6, 6)), -1) + np.eye(6))
    goals = of.goals @ pose.exp((L @ rng.standard_normal((n, 6, 1)))[..., 0])
    everything = np.ones(n, dtype=np.bool_)
    play_m = PLAYS_M[seed % 2]
    return Observation(of.assembly, of.start, goals, L @ np.swapaxes(L, 1, 2), everything, play_m=play_m)
