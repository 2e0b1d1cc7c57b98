"""Trials that several processes read, each its share of the lines."""

from __future__ import annotations

import os
import sys
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from apo_bench.records.run import trial_reader
from apo_bench.records.run.trial_reader import _lines_between, read_trials

KEPT = Path(__file__).parents[1] / "kept" / "sweep"


@given(st.text("ab\n", max_size=12), st.lists(st.integers(0, 12), max_size=4))
def test_each_complete_line_is_in_one_share(text: str, cuts: list[int]) -> None:
    written = text.encode()
    ends = sorted({0, len(written), *(min(cut, len(written)) for cut in cuts)})
    shares = [line for start, end in pairwise(ends) for line in _lines_between(BytesIO(written), start, end)]
    assert shares == [line for line in written.splitlines(keepends=True) if line.endswith(b"\n")]


@pytest.mark.skipif(sys.platform != "linux", reason="one process reads all")
def test_several_processes_read_what_one_does(monkeypatch: pytest.MonkeyPatch) -> None:
    alone = read_trials(KEPT)
    monkeypatch.setattr(os, "cpu_count", lambda: 3)
    monkeypatch.setattr(trial_reader, "_LEAST_SHARE", 1000)
    shared = read_trials(KEPT)
    assert len(shared) == len(alone) == 24
    for name in ("seed", "noise_mm", "success", "worst_gap_mm"):
        assert_array_equal(shared.number(name), alone.number(name))
    assert shared.coded("method").names == alone.coded("method").names
