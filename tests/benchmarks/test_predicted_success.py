"""Measures of predicted success, the table of its calibration, and assemblies of blocks."""

from __future__ import annotations

import numpy as np

from apo_bench.trial.predicted_success_table import RATES, SCORES
from benchmarks.predicted_success import KEPT, calibrate
from benchmarks.predicted_success_trials import CALIBRATION, read_lines


def test_the_table_is_made_of_the_committed_trials() -> None:
    scores, rates = calibrate([line for line in read_lines(KEPT) if line["set"] == CALIBRATION])
    np.testing.assert_allclose(SCORES, scores, atol=1e-4)
    np.testing.assert_allclose(RATES, rates, atol=1e-4)


def test_no_scenario_of_the_calibration_is_held_out() -> None:
    sets: dict[str, set[str]] = {}
    for line in read_lines(KEPT):
        sets.setdefault(line["scenario"], set()).add(line["set"])
    assert all(len(those) == 1 for those in sets.values())
