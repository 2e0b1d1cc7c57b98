"""Rates, intervals, the table and the figure."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from statsmodels.stats.proportion import proportion_confint

from apo_bench import InputError
from apo_bench.benchmark.analysis import Rate, compute_wilson_interval, tabulate_confusion, tabulate_effort, tally
from apo_bench.benchmark.report.report import write_report
from apo_bench.benchmark.report.tables.methods import summarise_predictions
from apo_bench.records import RECORD_SCHEMA, TrialConfig, list_setting_columns
from tests import pages

UNKNOWN = dict.fromkeys(
    (
        *("chi_square", "chi_square_dof", "p_value", "consistent", "suspects", "dropped_contacts", "wrong_contact"),
        *("inside_95", "planned_error_fixed_mm", "planned_error_free_mm"),
    )
)
"""What a row says where nothing was corrected or planned."""
UNCOUNTED = dict.fromkeys(("contacts_true_positive", "contacts_false_negative", "contacts_false_positive"))
"""What a row says of a method that is told no contacts."""


def row(method: str = "uncorrected", seed: int = 0, success: bool | None = True, **more: Any) -> dict[str, Any]:
    """What statistics looks at in a row."""
    failed = success is False
    met = 0.0 if method == "oracle" else 1.0
    return {
        "schema": RECORD_SCHEMA,
        "env_id": "APOReplay-v0",
        "config_hash": "0123456789abcdef",
        **list_setting_columns(TrialConfig("stick_in_tower"), "stick_in_tower"),
        **dict.fromkeys(("human_error_scale", "noise_mm", "noise_deg"), met),
        "method": method,
        "seed": seed,
        **UNKNOWN,
        "demonstration": "demonstration_failed" if success is None else "ok",
        "success": success,
        "as_demonstrated": success,
        "loose_success": success,
        "failure_stage": "attach" if failed else None,
        "failure_code": "force_stop" if failed else None,
        "failure_operation": 3 if failed else None,
        "failure_prediction": None if success is None else foretold(failed),
        "extra_steps": None if success is None else 0,
        "sim_time_s": None if success is None else 20.0,
        "placed_part_shift_mm": None if success is None else 0.1,
    } | more


def foretold(fails: bool, operation: int = 3) -> dict[str, Any]:
    """What a plan said about itself."""
    code, size = ("residual", 2.0) if fails else ("ok", 0.1)
    return {"fails": fails, "operation": operation if fails else None, "code": code, "size_mm": size}


def write(folder: Path, rows: list[dict[str, Any]]) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "trials.jsonl").write_text("".join(json.dumps(r) + "\n" for r in rows))
    return folder


@pytest.mark.parametrize(("successes", "trials", "expected"), [(81, 263, (0.2553, 0.3662))])
def test_wilson_published_examples(successes: int, trials: int, expected: tuple[float, float]) -> None:
    """Table I, method 3, of R. G. Newcombe, Two-sided confidence intervals for the single proportion, Statistics in
    Medicine 17 (1998), 857-872."""
    assert compute_wilson_interval(successes, trials) == pytest.approx(expected, abs=5e-5)
    assert compute_wilson_interval(successes, trials) == pytest.approx(
        proportion_confint(successes, trials, method="wilson"), abs=1e-12
    )


def test_what_was_not_executed_is_a_failure_and_stands_beside() -> None:
    """Nothing corrected, nothing seen, a plan refused or a dead worker: failures; of those carried out, 3 of 4."""
    stages = {1: "correct", 2: "observe", 3: "worker", 4: "judge", 5: "plan"}
    rows = [row(seed=i, success=i not in stages, failure_stage=stages.get(i)) for i in range(8)]
    (cell,) = tally([*rows, row(seed=9, success=None)])
    assert (cell.trials, cell.successes, cell.not_executed, cell.excluded) == (8, 3, 4, 1)
    assert (cell.rate, cell.executed, cell.wrong_when_executed) == (0.375, (3, 4), 0.25)
    assert cell.executed.interval == compute_wilson_interval(3, 4)
    assert Rate(0, 0).rate is None


def test_rows_are_counted_into_cells() -> None:
    rows = [
        row(seed=0),
        row(seed=1, success=False, loose_success=True),
        row(seed=2, success=False),
        row(seed=3, success=None),
        row(seed=4, success=False, failure_stage="judge", failure_code="gap"),
        row("oracle", seed=0),
        row(seed=0, noise_mm=None, noise_deg=None, human_error_scale=None),
    ]
    ceiling, raw = tally(rows)
    assert (ceiling.method, ceiling.trials, ceiling.rate) == ("oracle", 1, 1.0)
    assert (raw.trials, raw.successes, raw.loose_successes, raw.excluded) == (4, 1, 2, 1)
    assert list(raw.failures.items()) == [("attach: force_stop", 2), ("judge: gap", 1)]
    assert raw.rate == 0.25
    assert raw.interval == compute_wilson_interval(1, 4)


def test_predictions_are_counted_against_physics() -> None:
    rows = [
        row(seed=0),
        row(seed=1, failure_prediction=foretold(True)),
        row(seed=2, success=False),
        row(seed=3, success=False, failure_prediction=foretold(True, 2)),
        row(seed=4, success=False, failure_stage="judge", failure_code="gap", failure_operation=None),
        row(seed=5, success=False, failure_prediction=foretold(False)),
        row(seed=6, success=False, failure_stage="correct", failure_operation=None, failure_prediction=None),
        row(seed=7, success=None),
        row(
            seed=8,
            success=False,
            failure_stage="predicted-success",
            failure_code="abstained",
            failure_prediction=foretold(False),
        ),
        row("oracle", seed=0),
        row(seed=0, scenario="stick_on_castles", noise_mm=None, noise_deg=None, human_error_scale=None),
    ]
    ceiling, raw, measured, everything = tabulate_confusion(rows)
    assert list(raw.values()) == ["stick_in_tower", "uncorrected", 6, 4, 1, 1, 1, 3, 4 / 6, 1, 2, 2, 1]
    assert (ceiling["method"], ceiling["agreement"], measured["scenario"]) == ("oracle", 1.0, "stick_on_castles")
    assert (everything["scenario"], everything["method"], everything["executed"]) == ("all", "all", 8)
    assert everything["agreement"] == 6 / 8
    assert summarise_predictions(everything) == (
        "Predicted: 6 of 8 executed trials ended as predicted (75.0 %, counted by as_demonstrated); failures that were "
        "not predicted: 1, warnings that were wrong: 1."
    )


@settings(max_examples=30, deadline=None)
@given(results=st.lists(st.sampled_from([True, False, None]), max_size=30), order=st.randoms())
def test_every_row_is_counted_once_in_any_order(results: list[bool | None], order: Any) -> None:
    rows = [row("paper" if i % 2 else "uncorrected", seed=i, success=s) for i, s in enumerate(results)]
    shuffled = list(rows)
    order.shuffle(shuffled)
    cells = tally(rows)
    assert sum(c.trials + c.excluded for c in cells) == len(rows)
    assert [(c.method, c.trials, c.successes, c.excluded) for c in tally(shuffled)] == [
        (c.method, c.trials, c.successes, c.excluded) for c in cells
    ]


def test_the_report_says_what_the_rows_say(tmp_path: Path) -> None:
    rows = [row("oracle", seed=i) for i in range(4)]
    for level in (0.0, 0.5, 1.0):
        rows += [row(seed=i, success=i < 1, noise_mm=level, noise_deg=level) for i in range(4)]
        rows += [
            row("paper", seed=i, success=None if i == 3 else True, noise_mm=level, noise_deg=level) for i in range(4)
        ]
    made = write_report(write(tmp_path / "run", rows))
    table = list(csv.DictReader(made.tables["conditions"].open()))
    assert [(line["method"], line["noise_mm"], line["trials"], line["successes"]) for line in table] == [
        ("oracle", "0.0", "4", "4"),
        *(("uncorrected", level, "4", "1") for level in ("0.0", "0.5", "1.0")),
        *(("paper", level, "3", "3") for level in ("0.0", "0.5", "1.0")),
    ]
    assert math.isclose(float(table[1]["low_95"]), compute_wilson_interval(1, 4).low)
    (figure,) = [path for path in made.figures if path.name == "success_over_noise_level.png"]
    assert figure.read_bytes().startswith(b"\x89PNG")
    page = pages.lines(made.page)
    assert "| method, noise level: mm and degrees per axis | 0 | 0.5 | 1 |" in page
    assert "| uncorrected | 25.0 % 4.6 to 69.9 % n 4 | 25.0 % 4.6 to 69.9 % n 4 |" in page
    assert "| paper | 100.0 % 43.9 to 100.0 % n 3 excluded 1 | 100.0 % 43.9 to 100.0 % n 3 excluded 1 |" in page
    assert "| stick_in_tower | uncorrected | 12 | 3 | 0 | 0 | 9 | 100.0 % | 9 of 9 | 0 | 0 |" in page
    assert "| all | all | 25 | 16 | 0 | 0 | 9 | 100.0 % | 9 of 9 | 0 | 3 |" in page
    confusion = list(csv.DictReader(made.tables["confusion"].open()))
    assert [line["method"] for line in confusion] == ["oracle", "uncorrected", "paper", "all"]
    assert (confusion[1]["predicted_fail_failed"], confusion[2]["excluded"]) == ("9", "3")


def test_a_report_of_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no sweep"):
        write_report(tmp_path / "nowhere")
    with pytest.raises(InputError, match="no finished trial"):
        write_report(write(tmp_path / "empty", []))
    with pytest.raises(InputError, match=r"line 2: Object missing required field `schema`"):
        write_report(write(tmp_path / "bad", [row(), {"seed": 1}]))
    with pytest.raises(InputError, match="record of schema 'apo-bench/row/1'"):
        write_report(write(tmp_path / "old", [row(schema="apo-bench/row/1")]))


def test_effort_counts_what_was_right() -> None:
    rows = [
        row("paper", 0),
        row("paper-track", 0, extra_steps=2, sim_time_s=26.0, placed_part_shift_mm=0.3),
        row("paper-track", 1, extra_steps=4, sim_time_s=28.0, placed_part_shift_mm=0.2),
        row("paper-track", 2, success=False, extra_steps=9, sim_time_s=99.0, placed_part_shift_mm=9.0),
        row("uncorrected", 0, success=False),
    ]
    assert [list(line.values()) for line in tabulate_effort(rows)] == [
        ["stick_in_tower", "paper", 1, 0.0, 20.0, 0.1],
        ["stick_in_tower", "paper-track", 2, 3.0, 27.0, 0.3],
    ]
    assert tabulate_effort([]) == []
