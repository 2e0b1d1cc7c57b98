"""What is wrong in the folder of a sweep is one sentence with file, line and field."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from apo_bench import InputError
from apo_bench.benchmark.analysis import read_timing
from apo_bench.benchmark.report.comparison.compare import compare
from apo_bench.benchmark.report.comparison.text import comparison_form
from apo_bench.records.run.run_file import read_run
from apo_bench.records.run.trials import read_trials

FILES = ("trials.jsonl", "run.json", "timing.jsonl")

KEPT = Path(__file__).parents[1] / "kept" / "sweep"
"""2 scenarios, 2 levels, 3 methods, 2 seeds."""
pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="makes FIFOs")


def read(folder: Path) -> None:
    """All that `compare` does without writing, and the files that only `report` reads."""
    read_trials(folder)
    read_run(folder)
    read_timing(folder)
    json.dumps(comparison_form(compare(folder, KEPT)), allow_nan=False)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("trials.jsonl", '{"success": 1}', "line 1: Expected `bool | null`, got `int` - at `$.success`"),
        ("trials.jsonl", '{"noise_mm": null}', "line 1, field noise_mm: noise_mm and noise_deg and human_error_scale"),
        ("trials.jsonl", '{"method": "a\\u001bb"}', "line 1, field method: control characters are not allowed"),
        ("trials.jsonl", '{"worst_gap_mm": 1e999}', "line 1: Number out of range"),
        ("timing.jsonl", '{"trial_s": -1}', "line 1: Expected `float` >= 0.0 - at `$.trial_s`"),
        ("run.json", '{"grids": [3]}', "Expected `object`, got `int`"),
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
    assert str(refused.value).startswith(str(folder / name))
    assert said in str(refused.value)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"as_demonstrated": None}, "as_demonstrated and success are null together"),
        ({"success": False, "failure_stage": "judge", "failure_code": "gap"}, "it is true, so success must be true"),
    ],
)
def test_the_two_verdicts_go_together(changed: dict[str, Any], said: str, tmp_path: Path) -> None:
    (line, *_) = (KEPT / "trials.jsonl").read_text(encoding="utf-8").splitlines()
    right = json.loads(line)
    assert (right["success"], right["as_demonstrated"]) == (True, True)
    (tmp_path / "trials.jsonl").write_text(f"{json.dumps(right | changed)}\n", encoding="utf-8")
    with pytest.raises(InputError, match=f"line 1, field as_demonstrated: {said}"):
        read_trials(tmp_path)
