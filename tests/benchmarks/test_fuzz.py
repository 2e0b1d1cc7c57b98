"""Some hundred cases of the fuzz command, and that it sees what it looks for."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from apo_bench.resources import folder
from benchmarks import fuzz
from benchmarks.fuzz_mutate import RAN, STRUCTURES, mutated, named

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="cases run in forks of one process")


def test_a_hundred_cases_end_in_one_sentence_or_a_result(tmp_path: Path) -> None:
    """In a process of its own, which has no threads."""
    out = tmp_path / "fuzz.json"
    command = [sys.executable, "-m", "benchmarks.fuzz", "--cases", "100", "--seed", "1", "--write", str(out)]
    root = Path(fuzz.__file__).parents[1]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    found = json.loads(out.read_text())
    counts = sum((Counter(endings) for endings in found["counts"].values()), Counter())
    assert sum(counts.values()) == found["cases"] == 100
    assert set(counts) <= set(fuzz.FINE)
    assert counts["exit code 0"] > 5, "files that were changed too little to be refused"
    assert counts["exit code 2"] > 40
    assert len(found["counts"]) > 8
    assert {"bytes", "tokens", "structure"} <= set(found["levels"])


@pytest.mark.parametrize(
    ("code", "ending"),
    [
        ("raise KeyError('x')", "traceback"),
        ("raise SystemExit(3)", "traceback"),
        ("os._exit(3)", "exit code 3"),
        ("os.kill(os.getpid(), 9)", "signal 9"),
        ("print('\\x1b[2J')", "control characters"),
        ("print('apo-bench: one\\ntwo', file=sys.stderr)", "not one sentence"),
        ("x = bytearray(1_200_000_000)", "more than 1000 MB"),
        ("x = bytearray(20_000_000_000)", "traceback"),
        ("print('fine')", "exit code 0"),
        ("from benchmarks.fuzz_mutate import named\nnamed()", "exit code 0"),
    ],
)
def test_what_it_looks_for_is_seen(code: str, ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(_: list[str]) -> int:
        exec(f"import os, sys\n{code}")
        return 0

    monkeypatch.setattr(fuzz.cli, "main", run)
    assert fuzz._forked(tmp_path, ["scenarios"])[0] == ending


def test_a_report_that_runs_what_a_file_names_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fuzz.cli, "main", lambda _: named() or 0)
    assert fuzz._forked(tmp_path, ["report", "a"])[0] == RAN


def test_one_that_never_ends_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(_: list[str]) -> int:
        os.read(os.pipe()[0], 1)
        return 0

    monkeypatch.setattr(fuzz.cli, "main", run)
    monkeypatch.setattr(fuzz, "PATIENCE_S", 0.2)
    assert fuzz._forked(tmp_path, ["scenarios"])[0] == "longer than 10 s"


@pytest.mark.parametrize("suffix", STRUCTURES)
def test_files_are_changed_the_same_way_by_the_same_seed(suffix: str) -> None:
    raw = {
        ".toml": (folder("scenarios") / "stick_in_tower.toml").read_bytes(),
        ".xml": (folder("assets") / "parts" / "stick.xml").read_bytes(),
        ".json": b'{"a": [1, 2, {"b": null}], "c": "d"}',
        ".jsonl": b'{"a": 1}\n{"a": 2}\n',
        ".csv": b"a,b,c\n1,2,3\n4,5,6\n",
    }[suffix]
    for seed in range(50):
        once, again = (mutated(raw, suffix, np.random.default_rng(seed)) for _ in range(2))
        assert once == again
    assert len({mutated(raw, suffix, np.random.default_rng(seed)) for seed in range(50)}) > 35
