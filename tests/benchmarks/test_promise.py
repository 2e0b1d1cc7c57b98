"""What the benchmark of promises counts: pooled rates, errors of calibration, cells, and assemblies of blocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from apo_bench import TrialConfig, run_trial
from apo_bench.trial.predicted_success_table import RATES, SCORES
from benchmarks.promise import KEPT, pooled, table
from benchmarks.promise_page import calibration_error, skill, within
from benchmarks.promise_scenes import FAMILIES, blocks, scenario_of_blocks
from benchmarks.promise_trials import CALIBRATION, lines_of


def test_neighbours_that_fall_are_counted_together() -> None:
    scores, rates = pooled([0.1, 0.2, 0.3, 0.4], [0.0, 0.8, 0.2, 0.9], [1.0, 1.0, 3.0, 1.0])
    np.testing.assert_allclose(scores, [0.1, 0.275, 0.4])
    np.testing.assert_allclose(rates, [0.0, 0.35, 0.9])


@pytest.mark.parametrize("seed", range(5))
def test_pooled_rates_are_those_of_isotonic_regression(seed: int) -> None:
    from scipy import optimize

    if not hasattr(optimize, "isotonic_regression"):
        pytest.skip("SciPy 1.12 has it")
    rng = np.random.default_rng(seed)
    rates = rng.uniform(size=30)
    counts = rng.uniform(1.0, 9.0, size=30)
    _, mine = pooled(np.arange(30.0), rates, counts)
    np.testing.assert_allclose(mine, np.unique(optimize.isotonic_regression(rates, weights=counts).x), rtol=1e-12)


def test_numbers_of_promises_that_hold_and_of_some_that_do_not() -> None:
    right = np.array([1.0, 1.0, 0.0, 0.0])
    assert calibration_error(right, right) == 0.0
    assert calibration_error(1.0 - right, right) == 1.0
    assert within([0] * 4, right, right) == 1.0
    assert within([0, 1, 0, 1], 1.0 - right, right) == 0.0
    assert within([0, 0, 1, 1], right, right) != within([0] * 4, right, right), "no cell has both"
    assert skill([0] * 4, right, right) == 1.0


def test_the_table_is_made_of_the_trials_that_are_kept() -> None:
    scores, rates = table([line for line in lines_of(KEPT) if line["set"] == CALIBRATION])
    np.testing.assert_allclose(SCORES, scores, atol=1e-4)
    np.testing.assert_allclose(RATES, rates, atol=1e-4)


def test_no_trial_of_the_calibration_is_held_out() -> None:
    sets: dict[str, set[str]] = {}
    for line in lines_of(KEPT):
        sets.setdefault(line["scenario"], set()).add(line["set"])
    assert all(len(those) == 1 for those in sets.values())


@pytest.mark.parametrize("seed", range(100, 100 + len(FAMILIES)))
def test_an_assembly_of_blocks_is_put_together_by_who_knows_the_truth(seed: int, tmp_path: Path) -> None:
    assert len(blocks(seed).places) >= 2
    row = run_trial(TrialConfig(str(scenario_of_blocks(seed, tmp_path)), method="oracle", fidelity="near-contact"))
    assert row["success"]
    assert row["predicted_success"] > 0.5
