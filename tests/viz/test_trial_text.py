"""A person reads six lines of a trial, and no line hides the number that decides."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from apo_bench.assembly import Outcome
from apo_bench.trial.record_start_and_end import end_record
from apo_bench.viz.trial_text import format_summary
from tests.benchmark.analysis.test_rates import row


def record(success: bool, code: str = "gap", **more: Any) -> Any:
    end = end_record(Outcome("judge", code, None, "a gap is left"), success=success)
    return {**row("contact", 0, success, pose_source="noise-model"), **end, **more}


@pytest.mark.parametrize(
    ("code", "numbers", "line"),
    [
        ("gap", {"worst_gap_mm": 7.0}, ("worst gap", "7.000 mm between faces that should touch")),
        ("overlap", {"least_overlap": 0.25, "worst_gap_mm": 0.1}, ("least overlap", "25% of the true overlap")),
    ],
)
def test_the_fourth_line_is_the_number_that_decides(code: str, numbers: dict[str, Any], line: tuple[str, str]) -> None:
    lines = format_summary(record(False, code, **({"worst_gap_mm": None} | numbers)), "stick_in_tower")
    assert len(lines) == 6
    assert lines[3] == line


def test_the_last_line_shows_the_trial_again() -> None:
    file = "own/tower.toml"
    assert format_summary(record(True), file)[5][1].startswith(f"apo-bench run {file} ")
    measured = format_summary(record(True, noise_mm=None, noise_deg=None), file, Path("seen.csv"))
    assert measured[5][1] == f"apo-bench run {file} --clearance-mm 0.25 --method contact --observation seen.csv --view"
    assert "measured observation" in measured[0][1]
