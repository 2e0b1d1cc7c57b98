"""Calibration: what rows say about coverage, alarms and culprits."""

from __future__ import annotations

import math
from typing import Any

import pytest

from apo_bench.benchmark.analysis import tabulate_calibration
from apo_bench.benchmark.report.tables.methods import make_calibration_table
from tests.benchmark.analysis.test_rates import row


def corrected(seed: int, passes: bool, suspects: tuple[str, ...] = (), **more: Any) -> dict[str, Any]:
    """What calibration looks at in the row of a corrector with a test."""
    said = {"consistent": passes, "p_value": 0.5 if passes else 1e-6, "suspects": list(suspects)}
    errors = {"planned_error_fixed_mm": 0.3 + 0.1 * seed, "planned_error_free_mm": 2.0, "inside_95": seed > 0}
    return row("contact", seed=seed) | said | errors | more


def test_calibration_counts_coverage_alarms_and_culprits() -> None:
    wrong = {"contact_source": "face-offset:3mm", "wrong_contact": "R2"}
    rows = [
        *(
            row("oracle", seed=0),
            row("uncorrected", seed=0),
            row(seed=0, noise_mm=None, noise_deg=None, human_error_scale=None),
        ),
        *(
            corrected(0, True),
            corrected(1, False, ("R1",)),
            corrected(2, True, inside_95=None),
            row("contact", 3, None),
        ),
        *(
            corrected(0, True, **wrong),
            corrected(1, False, ("R1", "R2"), **wrong),
            corrected(2, False, ("R3",), **wrong),
        ),
        corrected(3, False, ("R3",), **wrong | {"contact_source": "false-negative", "wrong_contact": None}),
    ]
    raw, right, shifted, missed = tabulate_calibration(rows)
    assert [raw[name] for name in ("method", "covered", "failed_tests", "fixed_mm")] == [
        "uncorrected",
        (0, 0),
        (0, 0),
        None,
    ]
    assert [right[name] for name in ("covered", "failed_tests", "culprits")] == [(1, 2), (1, 3), (0, 0)]
    assert right["fixed_mm"] == pytest.approx(math.sqrt((0.09 + 0.16 + 0.25) / 3))
    assert right["fixed_over_clearance"] == pytest.approx(right["fixed_mm"] / 0.25)
    assert right["free_mm"] == 2.0
    assert (shifted["failed_tests"], shifted["culprits"]) == ((2, 3), (1, 2))
    assert (missed["failed_tests"], missed["culprits"]) == ((1, 1), (0, 0))
    lines = "\n".join(make_calibration_table((raw, right, missed, shifted)).markdown())
    assert "| uncorrected | 0 | – | – | – | – | – | – |" in lines
    assert "| face-offset:3mm | contact | 3 | 66.7 % of 3 | 0.408 | 1.63 | 2.000 | 66.7 % of 3 | 50.0 % of 2 |" in lines
