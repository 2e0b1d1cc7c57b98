"""`evaluate`: methods by name and as functions, over settings, in one call."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import apo_bench
from apo_bench.names import importable_name

QUICK: dict[str, Any] = {"human_error_scale": 0, "fidelity": "near-contact", "seeds": 1}


def as_observed(observation: apo_bench.Observation) -> np.ndarray:
    """Poses as they were observed: a corrector that corrects nothing."""
    return np.array(observation.poses)


@pytest.fixture(scope="module")
def table() -> apo_bench.RateTable:
    methods = {"mine": lambda observation: np.array(observation.poses), "uncorrected": "uncorrected"}
    return apo_bench.evaluate(methods, scenario="block_on_block", noise_level=[0.5, 2], **QUICK)


def test_each_condition_has_a_row(table: apo_bench.RateTable) -> None:
    assert [(row["method"], row["noise_mm"], row["trials"]) for row in table.rows] == [
        *[("mine", level, 1) for level in (0.5, 2.0)],
        *[("uncorrected", level, 1) for level in (0.5, 2.0)],
    ]
    assert all(row["low_95"] <= row["rate"] <= row["high_95"] for row in table.rows)
    assert "mine" in str(table)
    assert list(table.to_pandas()["successes"]) == [row["successes"] for row in table.rows]


def test_the_error_of_a_method_stands_below_the_table() -> None:
    methods = {"short": lambda observation: observation.poses[:1], "uncorrected": "uncorrected"}
    text = str(apo_bench.evaluate(methods, scenario="block_on_block", **QUICK))
    assert "short has an error in 1 trial, the first: " in text
    assert "(1, 4, 4)" in text.splitlines()[-1]


def test_functions_of_one_name_need_labels() -> None:
    functions = [lambda observation, k=k: observation.poses for k in range(2)]
    for function in functions:
        function.__name__ = "mine"
    with pytest.raises(apo_bench.InputError, match="several functions are named 'mine'"):
        apo_bench.evaluate(functions, scenario="block_on_block", **QUICK)


def test_a_script_without_a_guard_is_told_about_it_once(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import apo_bench\n"
        "apo_bench.evaluate('uncorrected', scenario='block_on_block', fidelity='near-contact', seeds=2, workers=2)\n"
    )
    ended = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert ended.returncode == 1
    assert ended.stderr.count("RuntimeError: ") == 1
    assert "__main__" in ended.stderr.splitlines()[-1]


def test_a_function_that_returns_the_observed_poses_is_the_method_uncorrected(table: apo_bench.RateTable) -> None:
    reached: dict[Any, list[Any]] = {}
    for record in table.records:
        reached.setdefault(record["method"], []).append((record["noise_mm"], record["final_poses"]))
    assert sorted(reached["mine"], key=str) == sorted(reached["uncorrected"], key=str)


def test_a_table_is_drawn_and_saved(table: apo_bench.RateTable, tmp_path: Path) -> None:
    assert table.plot(tmp_path / "success.svg").read_text(encoding="utf-8").startswith("<svg")
    table.save(tmp_path / "run")
    assert {"run.json", "trials.jsonl"} <= {path.name for path in (tmp_path / "run").iterdir()}
    with pytest.raises(apo_bench.InputError, match="save to another folder"):
        table.save(tmp_path / "run")
    with pytest.raises(apo_bench.InputError, match="ends in"):
        table.plot(tmp_path / "success.pdf")


def test_a_run_that_is_saved_is_continued(tmp_path: Path) -> None:
    asked: dict[str, Any] = {"scenario": "block_on_block", "save": tmp_path / "run", **QUICK, "noise_level": 1}
    apo_bench.evaluate("uncorrected", **asked)
    before = (tmp_path / "run" / "trials.jsonl").read_bytes()
    assert len(apo_bench.evaluate("uncorrected", **asked).records) == 1
    assert (tmp_path / "run" / "trials.jsonl").read_bytes() == before
    with pytest.raises(apo_bench.InputError, match="cannot be recognized again"):
        apo_bench.evaluate(lambda observation: observation.poses, **asked)


def test_a_function_without_a_module_stays_in_this_process() -> None:
    with pytest.raises(apo_bench.InputError, match="use workers=1"):
        apo_bench.evaluate({"mine": lambda o: o.poses}, scenario="block_on_block", noise_level=1, workers=2, **QUICK)
    assert "session" not in sys.modules
    assert importable_name(np.array) is None or ":" in str(importable_name(np.array))
    assert importable_name(apo_bench.evaluate) == "apo_bench.benchmark.evaluation:evaluate"
    assert importable_name(lambda: 0) is None


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"scenario": "no_such"}, "no_such"),
        ({"noise_level": -1}, "noise level must be a number from 0 to 50, got -1"),
        ({"noise_lvl": 1}, "noise_lvl"),
    ],
)
def test_a_wrong_argument_is_one_sentence(wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(apo_bench.InputError, match=said):
        apo_bench.evaluate("uncorrected", **({"scenario": "block_on_block", "noise_level": 1} | QUICK | wrong))


@pytest.mark.parametrize(
    ("methods", "said"),
    [
        (3, "method must be a name, a function"),
        ({"contact": as_observed}, "'contact' is a method of the package; use another label"),
    ],
)
def test_a_wrong_method_is_one_sentence(methods: Any, said: str) -> None:
    with pytest.raises(apo_bench.InputError, match=said):
        apo_bench.evaluate(methods, scenario="block_on_block", noise_level=1, **QUICK)


def test_one_trial_takes_a_scenario_and_keywords() -> None:
    asked: dict[str, Any] = {"noise_level": (2, 1), "seed": 3, "human_error_scale": 0, "fidelity": "near-contact"}
    by_name = apo_bench.run_trial("block_on_block", method="uncorrected", **asked)
    scenario = apo_bench.load_scenario("block_on_block")
    own = apo_bench.run_trial(scenario, method=as_observed, **asked)
    (again,) = apo_bench.evaluate(as_observed, scenario=scenario, **{**asked, "noise_level": [(2, 1)]}, seeds=1).records
    assert again["final_poses"] == own["final_poses"]
    assert (by_name["noise_mm"], by_name["noise_deg"], by_name["clearance_mm"]) == (2.0, 1.0, 0.25)
    assert own["final_poses"] == by_name["final_poses"]
    assert own["method"].endswith(":as_observed")
    with pytest.raises(apo_bench.InputError, match="did you mean 'noise_level'"):
        apo_bench.run_trial("block_on_block", noise_lvl=1)
    with pytest.raises(apo_bench.InputError, match="put it into that"):
        apo_bench.run_trial(apo_bench.TrialConfig("block_on_block"), seed=3)
