"""Whatever of a folder is altered, `report` and `compare` read it or say in one sentence what is wrong."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from apo_bench import InputError
from apo_bench.benchmark.analysis import read_timing
from apo_bench.benchmark.report import report as reports
from apo_bench.benchmark.report.comparison.compare import compare
from apo_bench.benchmark.report.comparison.text import comparison_form
from apo_bench.io import clean
from apo_bench.records.run.run_file import read_run
from apo_bench.records.run.trials import read_trials
from tests.altered import FILES, altered

KEPT = Path(__file__).parents[1] / "kept" / "sweep"
"""2 scenarios, 2 levels, 3 methods, 2 seeds."""
CASES = 100
WHOLE = 2
pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="makes FIFOs")


def read(folder: Path) -> None:
    """All that `compare` does without writing, and the files that only `report` reads."""
    read_trials(folder)
    read_run(folder)
    read_timing(folder)
    json.dumps(comparison_form(compare(folder, KEPT)), allow_nan=False)


def test_altered_folders_are_read_or_refused_in_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reports, "figures", lambda *_: {})  # figures take a second each
    refused = reported = 0
    wrong: list[tuple[str, str]] = []
    for seed in range(CASES):
        what = altered(KEPT, tmp_path / "run", np.random.default_rng(seed))
        try:
            read(tmp_path / "run")
            if reported < WHOLE:
                reports.report(tmp_path / "run")
                reported += 1
        except InputError as error:
            refused += 1
            said = clean(str(error))
            whole = any(name in said for name in FILES) or "holds a trial twice" in said or "in common" in said
            wrong += [] if whole and "\n" not in str(error) and len(said) < 600 else [(what, said)]
        except Exception as error:
            raise AssertionError(f"seed {seed}: {what}") from error
    assert wrong == []
    assert refused > CASES / 3
    assert reported == WHOLE


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("trials.jsonl", '{"success": 1}', "line 1, field success: true or false or null is needed, a whole number"),
        ("trials.jsonl", '{"seed": -1}', "line 1, field seed: a whole number >= 0 is needed"),
        (
            "trials.jsonl",
            '{"noise_mm": null}',
            "line 1, field level: level and level_deg and careless are null together",
        ),
        ("trials.jsonl", '{"failure_stage": "nowhere"}', "line 1, field failure_stage: 'nowhere' is none of"),
        ("trials.jsonl", '{"method": "a\\u001bb"}', "line 1, field method: text without control characters is needed"),
        (
            "trials.jsonl",
            '{"reached": {"a": [1]}}',
            "field reached (an entry): a list of length >= 7 is needed",
        ),
        ("trials.jsonl", '{"worst_gap_mm": 1e999}', "line 1, field worst_gap_mm: number out of range"),
        ("timing.jsonl", '{"trial_s": -1}', "line 1, field trial_s: a number >= 0.0 is needed"),
        ("run.json", '{"grids": [3]}', "field grids[0]: an object is needed"),
        ("run.json", '{"mine": ["\\ud800"]}', "field mine[0]: text without half letters"),
    ],
)
def test_the_sentence_names_file_line_and_field(name: str, text: str, said: str, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    for file in FILES:
        (folder / file).write_bytes((KEPT / file).read_bytes())
    if name == "run.json":
        (folder / name).write_text(text, encoding="utf-8")
    else:
        lines = (folder / name).read_text(encoding="utf-8").splitlines()
        lines[0] = json.dumps(json.loads(lines[0]) | json.loads(text)).replace("Infinity", "1e999")
        (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    with pytest.raises(InputError) as refused:
        read(folder)
    assert str(refused.value).startswith(f"{folder / name}, ")
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("name", "once", "twice", "key"),
    [
        ("trials.jsonl", '"seed":', '"seed": 9, "seed":', "line 1: the key 'seed'"),
        ("trials.jsonl", '"thresholds": {', '"thresholds": {"a": 1, "a": 1, ', "line 1: the key 'a'"),
        ("run.json", "{", '{"mine": {"a": 1, "a": 1}, ', "the key 'a'"),
    ],
)
def test_a_key_that_stands_twice_is_refused(name: str, once: str, twice: str, key: str, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    for file in FILES:
        (folder / file).write_bytes((KEPT / file).read_bytes())
    read(folder)
    text = (KEPT / name).read_text(encoding="utf-8")
    assert once in text
    (folder / name).write_text(text.replace(once, twice, 1), encoding="utf-8")
    with pytest.raises(InputError, match=f"{name}.*{key} stands twice in one object"):
        read(folder)


def test_names_of_files_that_are_not_utf_8_may_stand_in_a_run(tmp_path: Path) -> None:
    """The library of the language writes them with half letters, and a sweep keeps its command."""
    (tmp_path / "run.json").write_text(json.dumps({"command": "sweep b\udcf6.toml"}), encoding="utf-8")
    assert read_run(tmp_path) == {"command": "sweep b\udcf6.toml"}


def test_a_key_that_nobody_knows_is_left_out(tmp_path: Path) -> None:
    """Nothing reads it; people add their own notes."""
    folder = tmp_path / "run"
    folder.mkdir()
    line = (KEPT / "trials.jsonl").read_text(encoding="utf-8").splitlines()[0]
    noted = json.dumps(json.loads(line) | {"note": {"a": [1]}})
    (folder / "trials.jsonl").write_text(f"{noted}\n", encoding="utf-8")
    (row,) = read_trials(folder).rows()
    assert "note" not in row


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"as_demonstrated": None}, "as_demonstrated and success are null together"),
        ({"success": False, "failure_stage": "judge", "failure_code": "gap"}, "it is true, so success is needed"),
    ],
)
def test_the_two_verdicts_go_together(changed: dict[str, Any], said: str, tmp_path: Path) -> None:
    (line, *_) = (KEPT / "trials.jsonl").read_text(encoding="utf-8").splitlines()
    right = json.loads(line)
    assert (right["success"], right["as_demonstrated"]) == (True, True)
    (tmp_path / "trials.jsonl").write_text(f"{json.dumps(right | changed)}\n", encoding="utf-8")
    with pytest.raises(InputError, match=f"line 1, field as_demonstrated: {said}"):
        read_trials(tmp_path)
