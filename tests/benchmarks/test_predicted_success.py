"""The trials that measure predicted success, and what the package must not know of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import apo_bench
from benchmarks.held_out import CONTACTS, NOISES
from benchmarks.predicted_success import KEPT
from benchmarks.predicted_success_page import auc_within, calibration_error
from benchmarks.predicted_success_trials import read_lines


def test_no_scenario_of_the_calibration_is_held_out() -> None:
    sets: dict[str, set[str]] = {}
    for line in read_lines(KEPT):
        sets.setdefault(line["scenario"], set()).add(line["set"])
    assert all(len(those) == 1 for those in sets.values())


def test_the_package_names_no_process_of_the_test() -> None:
    code = "\n".join(path.read_text(encoding="utf-8") for path in Path(apo_bench.__file__).parent.rglob("*.py"))
    # these are plain words, and a key of files in BOP format
    special = {*NOISES, *CONTACTS} - {"white", "lag", "mixture", "lost", "depth_scale"}
    assert not [name for name in special if f"def {name}" in code or f'"{name}"' in code]


def test_measures_of_a_prediction_that_is_right_on_average() -> None:
    rng = np.random.default_rng(1)
    predicted = rng.uniform(size=20_000)
    right = (rng.uniform(size=20_000) < predicted).astype(float)
    assert calibration_error(predicted, right) < 0.02
    assert calibration_error(np.sqrt(predicted), right) > 0.1
    # of uniform predictions the AUC is 5/6 - 0: two independent ones, weighted by p and 1 - p
    assert auc_within([""] * 20_000, predicted, right) == pytest.approx(5 / 6, abs=0.01)
