"""Errors that are made on purpose: each in a copy, noticed by the tests of its room or not."""

from __future__ import annotations

import subprocess
from collections import Counter
from pathlib import Path

import pytest

from benchmarks.fault_list import FAULTS, Fault
from benchmarks.faults import is_possible, put, run

CODE = "def larger(a, b):\n    return a if a > b else b\n\n\ndef least(a, b):\n    return min(a, b)\n"
TEST = "from apo_bench.toy.one import larger\n\n\ndef test_the_larger():\n    assert larger(1, 2) == 2\n"
SIGN = Fault("toy/one.py", "a > b", "a < b", "a sign")
OTHER = Fault("toy/one.py", "min(a, b)", "max(a, b)", "what no test asks")


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A checkout with one room and one test."""
    for name, text in (("apo_bench/toy/one.py", CODE), ("tests/toy/test_one.py", TEST)):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "apo_bench" / "__init__.py").touch()
    (tmp_path / ".gitignore").write_text("work\n")
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = extras\npythonpath = .\n")
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    return tmp_path


def test_an_error_is_noticed_or_not_and_the_checkout_stays_as_it_is(root: Path) -> None:
    noticed, missed = (run(root, error, root / "work") for error in (SIGN, OTHER))
    assert (noticed.passed, noticed.by) == (False, "tests/toy/test_one.py::test_the_larger")
    assert missed.passed
    assert missed.by.startswith("1 passed")
    assert (root / "apo_bench" / "toy" / "one.py").read_text() == CODE


def test_an_error_is_made_where_its_text_is_once_and_nowhere_else(root: Path) -> None:
    for before in ("a, b", "nowhere"):
        assert not is_possible(SIGN._replace(before=before), root)
        with pytest.raises(RuntimeError, match="exactly once"):
            put(SIGN._replace(before=before), root)
    put(SIGN, root)
    assert (root / "apo_bench" / "toy" / "one.py").read_text() == CODE.replace("a > b", "a < b")


def test_errors_are_fifty_and_most_are_where_results_are_decided() -> None:
    rooms = Counter(fault.room for fault in FAULTS)
    assert len({(fault.file, fault.before) for fault in FAULTS}) == sum(rooms.values()) == 50
    assert min(rooms[room] for room in ("geometry", "correction", "judging", "sweeps", "parts", "scenario")) >= 5
    assert all(fault.before != fault.after for fault in FAULTS)
