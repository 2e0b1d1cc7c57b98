"""The table of fields: what is written has just these, and can be read again."""

from __future__ import annotations

import json
from typing import Any

import pytest

from apo_bench import TrialConfig, build_scene, load_scenario, run_trial
from apo_bench.benchmark.sweeps.worker import make_timing
from apo_bench.records import RECORD_FIELDS, REQUIRED
from apo_bench.records.run.validation import TIMING_FIELDS, decode_record, decode_timing, describe_unwritable
from apo_bench.trial.record_start_and_end import record_corrector_failure, record_lost_trial

SPEC = TrialConfig("block_on_block", noise_mm=3.0, noise_deg=2.0, method="paper", seed=2)


@pytest.fixture(scope="module")
def made() -> list[dict[str, Any]]:
    """Rows of every way in which a trial ends: run, of a corrector that misbehaved, of a process that died."""
    scene = build_scene(load_scenario("block_on_block"))
    return [
        run_trial(SPEC, scene),
        record_corrector_failure(SPEC, "0", "ok", "it raised\n\x1b" + "x" * 5000),
        record_lost_trial(SPEC, "0", "time_limit"),
    ]


def test_what_was_written_is_read_as_it_was(made: list[dict[str, Any]]) -> None:
    for row in made:
        line = json.dumps(row, allow_nan=False).encode()
        assert decode_record(line, "line 1") == dict.fromkeys(RECORD_FIELDS) | row
        times = make_timing(row, None, 0.1, 0.2, {"worker": 0})
        assert decode_timing(json.dumps(times).encode(), "line 1") == times
        assert set(times) == set(TIMING_FIELDS)


@pytest.mark.parametrize(
    "changed",
    [
        {"invented": 1},
        {"worst_gap_mm": float("nan")},
        {"dropped_contacts": [3]},
        {"p_value": 2.0},
        {"wrong_contact": "\ud800"},
    ],
)
def test_a_record_that_could_not_be_read_is_not_written(changed: dict[str, Any], made: list[dict[str, Any]]) -> None:
    assert describe_unwritable(made[0] | changed)


def test_what_every_record_has_is_required(made: list[dict[str, Any]]) -> None:
    for name in REQUIRED:
        row = {key: value for key, value in made[0].items() if key != name}
        assert f"`{name}`" in describe_unwritable(row)


def test_a_corrector_that_returns_what_no_row_holds_has_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    from apo_bench.trial import run
    from apo_bench.trial.trial_stages import simulate_demonstration

    scene = build_scene(load_scenario("block_on_block"))
    shown = simulate_demonstration(scene, SPEC.human_error_scale, SPEC.seed)
    right = run_trial(SPEC, scene, simulated=shown)
    monkeypatch.setattr(run, "run_trial", lambda *_, **__: right | {"p_value": 7.0})
    mine = TrialConfig("block_on_block", method="mine:correct")
    row = run.record_trial(mine, scene, shown, "0")
    assert (row["failure_stage"], row["failure_code"]) == ("correct", "raised")
    assert "returned what no record can hold (" in row["sentence"]
