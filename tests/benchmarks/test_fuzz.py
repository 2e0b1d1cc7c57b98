"""Some hundred cases of the fuzz command, and that it sees what it looks for."""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import zipfile
from collections import Counter
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from apo_bench.resources import folder
from benchmarks import fuzz
from benchmarks.fuzz_mutate import RAN, STRUCTURES, mutated, named
from benchmarks.fuzz_watch import IMPORTED, STARTED, WROTE, changed_files, lay_out


def packed(model: str) -> bytes:
    out = BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr(zipfile.ZipInfo("a.model"), model)
    return out.getvalue()


pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="cases run in forks of one process")


def test_sixty_cases_end_in_one_sentence_or_a_result(tmp_path: Path) -> None:
    """In a process of its own, which has no threads."""
    out = tmp_path / "fuzz.json"
    command = [sys.executable, "-m", "benchmarks.fuzz", "--cases", "60", "--seed", "1", "--write", str(out)]
    root = Path(fuzz.__file__).parents[1]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    found = json.loads(out.read_text())
    of_kinds = found["kinds"]
    counts = sum((Counter(of["endings"]) for of in of_kinds.values()), Counter())
    assert sum(counts.values()) == found["cases"] == 60
    assert found["wrong"] == 0
    assert set(counts) <= set(fuzz.FINE)
    assert counts["exit code 0"] > 3, "files that were changed too little to be refused"
    assert counts["exit code 2"] > 24
    assert len(of_kinds) > 12
    assert {"bytes", "tokens", "structure"} <= {level for of in of_kinds.values() for level in of["levels"]}


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
        ("from benchmarks.fuzz_mutate import named\nnamed()", RAN),
        ("open('../beside', 'w')", WROTE),
        ("os.mkdir('../folder')", WROTE),
        ("os.symlink('x', '../link')", WROTE),
        ("os.replace('fifo', '../fifo')", WROTE),
        ("open('here', 'w')", "exit code 0"),
        ("import tempfile\ntempfile.TemporaryFile()", "exit code 0"),
        ("os.system('true')", STARTED),
        ("import subprocess\nsubprocess.run(['true'])", STARTED),
        ("import subprocess\nsubprocess.run([sys.executable, '-c', ''])", "exit code 0"),
        ("import socket\nsocket.socket().connect_ex(('127.0.0.1', 1))", STARTED),
        ("sys.path.append(os.getcwd())\nimport sksparse", IMPORTED),
    ],
)
def test_what_it_looks_for_is_seen(code: str, ending: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(_: list[str]) -> int:
        exec(f"import os, sys\n{code}")
        return 0

    monkeypatch.setattr(fuzz.cli, "main", run)
    place = tmp_path / "case"
    lay_out({}, place)
    assert fuzz._forked(place, ["scenarios"])[0] == ending


def test_files_that_are_left_are_those_that_were_asked_for(tmp_path: Path) -> None:
    place = tmp_path / "case"
    lay_out({"a.toml": b"a"}, place)
    assert changed_files(place, {"a.toml": b"a"}, []) == ""
    (place / "out").mkdir()
    (place / "out" / "b.xml").touch()
    assert changed_files(place, {"a.toml": b"a"}, ["out/*"]) == ""
    assert changed_files(place, {"a.toml": b"a"}, []) == f"{WROTE}: out/b.xml"
    assert changed_files(place, {"a.toml": b"b"}, ["out/*"]) == f"{WROTE}: a.toml is not what it was"
    (place / "a.toml").unlink()
    assert changed_files(place, {"a.toml": b"a"}, ["out/*"]) == f"{WROTE}: a.toml is gone"


def test_a_process_that_a_command_leaves_behind_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The pipe ends with the last process that holds it."""
    ours, theirs = os.pipe()

    def run(_: list[str]) -> int:
        if not os.fork():
            os.read(os.pipe()[0], 1)
        return 0

    monkeypatch.setattr(fuzz.cli, "main", run)
    assert fuzz._forked(tmp_path, ["scenarios"])[0] == "exit code 0"
    os.close(theirs)
    assert select.select([ours], [], [], 60)[0], "it still waits"
    assert os.read(ours, 1) == b""
    os.close(ours)


def test_results_of_other_kinds_are_kept() -> None:
    case = fuzz.Ended(0, "part", "bytes", ["scenarios"], "exit code 2", 0.1, 90, "")
    kept = fuzz.summary([case], "first", {})
    both = fuzz.summary([case._replace(kind="arm", ending="traceback")], "second", kept)
    assert (both["cases"], both["wrong"]) == (2, 1)
    assert [of["command"] for of in both["kinds"].values()] == ["second", "first"]
    again = fuzz.summary([case._replace(kind="arm")], "third", both)
    assert (again["cases"], again["wrong"]) == (2, 0)


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
        ".txt": b"0.1 1 2 3\n0.2 4 5 6\n",
        ".obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        ".stl": bytes(80) + b"\3\0\0\0" + bytes(range(150)),
        ".3mf": packed("<model><resources/><build/></model>"),
    }[suffix]
    for seed in range(50):
        once, again = (mutated(raw, suffix, np.random.default_rng(seed)) for _ in range(2))
        assert once == again
    assert len({mutated(raw, suffix, np.random.default_rng(seed)) for seed in range(50)}) > 35


def test_what_a_reader_of_the_fuzzers_own_cannot_read_is_changed_as_bytes() -> None:
    """An archive whose flags were changed before, as compressed patched data."""
    raw = bytearray(packed("<model/>"))
    raw[raw.index(b"PK\1\2") + 8] |= 0x20
    raw[6] |= 0x20
    levels = {mutated(bytes(raw), ".3mf", np.random.default_rng(seed))[0] for seed in range(40)}
    assert levels == {"bytes", "tokens", "structure"}
