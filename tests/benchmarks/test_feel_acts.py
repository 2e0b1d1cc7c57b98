"""Trials with acts of feeling left out: which are run, which count, and the table of them."""

import json
import sys

import pytest

from apo_bench.simulation.execution.probing.config import PROBING_ACTIONS
from benchmarks import feel_acts
from benchmarks.feel_acts import ALL, HALF_STEP, VARIANTS, Case, acts_of, lines_of, missing, settings_of, table
from benchmarks.robot_errors import page

HERE = ("stick_in_tower", "oracle+probe")


def line(variant, seed, success, scenario=HERE[0]):
    return Case(scenario, HERE[1], variant, seed)._asdict() | {"success": success, "code": "ok"}


def test_every_act_is_left_out_once():
    assert acts_of(ALL) == acts_of(HALF_STEP) == PROBING_ACTIONS
    assert [set(PROBING_ACTIONS) - set(acts_of(act)) for act in PROBING_ACTIONS] == [{act} for act in PROBING_ACTIONS]


def test_half_the_step_changes_nothing_else():
    usual, half = (settings_of(Case(*HERE, variant, 3)) for variant in (ALL, HALF_STEP))
    assert vars(half) == vars(usual) | {"timestep_s": usual.timestep_s / 2}
    assert usual.robot_error.count("+") == 3
    assert (usual.human_error_scale, usual.noise_mm, usual.fidelity) == (0.0, 1.0, "contact")


def test_what_is_there_is_not_run_again():
    known = [line(ALL, 0, True)]
    todo = missing(2, *([each] for each in HERE), VARIANTS, known)
    assert len(todo) == 2 * len(VARIANTS) - 1
    assert [case.seed for case in todo] == sorted(case.seed for case in todo)
    assert Case(*HERE, ALL, 0) not in todo


def test_half_a_line_is_no_trial(tmp_path):
    file = tmp_path / "acts.jsonl"
    file.write_text(json.dumps(line(ALL, 0, True)) + "\n" + '{"scenario": "sti', encoding="utf-8")
    assert lines_of(file) == [line(ALL, 0, True)]
    assert lines_of(tmp_path / "none.jsonl") == []


def test_the_table_counts_pairs():
    lines = [line(ALL, seed, True) for seed in range(4)] + [line("lay", seed, seed > 1) for seed in range(5)]
    lines += [line("lay", 9, None)]
    said = table(lines).splitlines()
    assert said[2] == "| `oracle+probe` | nothing | 4 of 4 | 4 of 4 (51 to 100 %) |  |"
    assert said[3] == "| `oracle+probe` | `lay` | 3 of 5 | 3 of 5 (23 to 88 %) | 2, 0 |"
    assert "## Each act left out" in page([], lines)
    assert "## Each act left out" not in page([])


def test_a_method_that_does_not_feel_is_refused(tmp_path, monkeypatch, capsys):
    out = tmp_path / "acts.jsonl"
    monkeypatch.setattr(sys, "argv", ["feel_acts", "--out", str(out), "--method", "oracle"])
    with pytest.raises(SystemExit):
        feel_acts.main()
    assert "write oracle+probe" in capsys.readouterr().err
    assert not out.exists()
