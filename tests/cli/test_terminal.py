"""What a person reads of one trial: no sentence hides the number that decides."""

from __future__ import annotations

from typing import Any

import pytest

from apo_bench.assembly import Outcome
from apo_bench.benchmark.analysis import tally
from apo_bench.cli.terminal import print_cells
from apo_bench.cli.trial_text import print_row
from apo_bench.trial.endings import end_record
from tests.benchmark.analysis.test_rates import row

REACHED = {"worst_gap_mm": 7.0, "least_overlap": 1.0}


def told(capsys: pytest.CaptureFixture[str], success: bool, **more: Any) -> str:
    end = end_record(Outcome("judge", "gap", None, "a gap is left"), success=success)
    print_row({**row("contact", 0, success, pose_source="noise-model"), **end, **more})  # type: ignore[typeddict-item]
    return capsys.readouterr().out


def test_a_contact_that_was_not_made_is_told_with_its_gap_whatever_the_overlap(
    capsys: pytest.CaptureFixture[str],
) -> None:
    said = told(capsys, False, **REACHED, loose_success=False)
    assert "not every contact was made, even loosely" in said
    assert "least overlap 1.00, worst gap 7.000 mm" in said
    assert "not every" not in told(capsys, False, **REACHED, loose_success=True)


@pytest.mark.parametrize(
    ("p", "passes", "words"),
    [
        (0.84, True, "chi-square 8.0 of 13, p 0.84: explained by the stated noise"),
        (0.0, False, "p < 1e-300: not explained by the stated noise; one of R2, R4 may be wrong"),
    ],
)
def test_a_test_says_whether_it_passes(p: float, passes: bool, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    suspects = [] if passes else ["R2", "R4"]
    more = {"chi_square": 8.0, "chi_square_dof": 13, "p_value": p, "test_passes": passes, "suspects": suspects}
    assert words in told(capsys, True, **more)


@pytest.mark.parametrize(("count", "words"), [(1, "1 row is left out"), (2, "2 rows are left out")])
def test_demonstrations_that_failed_are_counted(count: int, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    print_cells(tally([row("contact", 9), *(row("contact", i, None) for i in range(count))]))
    assert words in capsys.readouterr().out


def test_what_a_robot_felt_is_a_line_and_what_it_was_given_stands_with_the_trial(
    capsys: pytest.CaptureFixture[str],
) -> None:
    sizes = {
        "probe_contacts": 9,
        "probe_contacts_rejected": 1,
        "base_error_estimate_mm": 0.62,
        "base_error_estimate_deg": 0.08,
    }
    sizes |= {
        "base_error_std_mm": 0.05,
        "base_error_std_deg": 0.01,
        "ft_sensor": "joint-torque",
        "assumed_robot_error": "matched",
    }
    said = " ".join(told(capsys, True, **{**sizes, "method": "contact+probe"}).split())
    assert "its base is off by 0.62 mm and 0.08 degrees (deviations 0.05 and 0.01): 9 touches, 1 more refused" in said
    assert ", wrench cobot" in said
    assert "stated error" not in said
    assert "ft_sensor" not in told(capsys, True, ft_sensor="joint-torque", touches=None)
