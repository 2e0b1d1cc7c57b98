"""Measures of predicted success, the table of its calibration, and assemblies of blocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from apo_bench import TrialConfig, run_trial
from apo_bench.trial.predicted_success_table import RATES, SCORES
from benchmarks.block_assemblies import FAMILIES, blocks, scenario_of_blocks
from benchmarks.predicted_success import KEPT, calibrate
from benchmarks.predicted_success_page import auc_within, calibration_error, skill
from benchmarks.predicted_success_trials import CALIBRATION, read_lines

ONE = [()] * 4


def test_measures_of_right_and_of_wrong_predictions() -> None:
    right = np.array([1.0, 1.0, 0.0, 0.0])
    pairs = [("a",), ("b",), ("a",), ("b",)]
    assert (calibration_error(right, right), calibration_error(1.0 - right, right)) == (0.0, 1.0)
    assert (auc_within(ONE, right, right), auc_within(pairs, 1.0 - right, right)) == (1.0, 0.0)
    assert np.isnan(auc_within([("a",), ("a",), ("b",), ("b",)], right, right)), "no group has both"
    assert skill(ONE, right, right) == 1.0


def test_the_table_is_made_of_the_committed_trials() -> None:
    scores, rates = calibrate([line for line in read_lines(KEPT) if line["set"] == CALIBRATION])
    np.testing.assert_allclose(SCORES, scores, atol=1e-4)
    np.testing.assert_allclose(RATES, rates, atol=1e-4)


def test_no_scenario_of_the_calibration_is_held_out() -> None:
    sets: dict[str, set[str]] = {}
    for line in read_lines(KEPT):
        sets.setdefault(line["scenario"], set()).add(line["set"])
    assert all(len(those) == 1 for those in sets.values())


@pytest.mark.parametrize("seed", range(100, 100 + len(FAMILIES)))
def test_the_oracle_builds_an_assembly_of_blocks(seed: int, tmp_path: Path) -> None:
    assert len(blocks(seed).places) >= 2
    row = run_trial(TrialConfig(str(scenario_of_blocks(seed, tmp_path)), method="oracle", fidelity="near-contact"))
    assert row["success"]
    assert row["predicted_success"] is not None
    assert row["predicted_success"] > 0.5
