"""What is wrong in the folder of a sweep is one sentence with file, line and field."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from apo_bench import InputError
from apo_bench.benchmark.analysis import read_timing
from apo_bench.benchmark.report.comparison.compare import compare
from apo_bench.benchmark.report.comparison.text import make_comparison_form
from apo_bench.records.run.run_file import read_run
from apo_bench.records.run.trial_reader import read_trials

FILES = ("trials.jsonl", "run.json", "timing.jsonl")

KEPT = Path(__file__).parents[1] / "kept" / "sweep"
"""2 scenarios, 2 levels, 3 methods, 2 seeds."""
pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="makes FIFOs")


def read(folder: Path) -> None:
    """All that `compare` does without writing, and the files that only `report` reads."""
    read_trials(folder)
    read_run(folder)
    list(read_timing(folder))
    json.dumps(make_comparison_form(compare(folder, KEPT)), allow_nan=False)


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("trials.jsonl", '{"success": 1}', "line 1: Expected `bool | null`, got `int` - at `$.success`"),
        ("trials.jsonl", '{"noise_mm": null}', "line 1, field noise_mm: noise_mm and noise_deg and human_error_scale"),
        ("trials.jsonl", '{"worst_gap_mm": 1e999}', "line 1: Number out of range"),
    ],
)
def test_the_sentence_names_file_line_and_field(name: str, text: str, said: str, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    for file in FILES:
        (folder / file).write_bytes((KEPT / file).read_bytes())
    lines = (folder / name).read_text(encoding="utf-8").splitlines()
    lines[0] = json.dumps(json.loads(lines[0]) | json.loads(text)).replace("Infinity", "1e999")
    (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    with pytest.raises(InputError) as refused:
        read(folder)
    assert str(refused.value).startswith(str(folder / name))
    assert said in str(refused.value)
