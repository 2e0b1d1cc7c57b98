"""What a sweep shows while it runs: on a terminal alone."""

from __future__ import annotations

import io
import os
import sys
from contextlib import suppress
from typing import Any

import pytest
from rich.console import Console

from apo_bench.sweeps.progress import Rates, progress


def row(method: str, level: float, success: bool | None, **more: Any) -> dict[str, Any]:
    place = {"scenario": "block_on_block", "clearance_mm": 0.25, "grasp": "friction", "noise": "isotropic"}
    told = {"relations": "given", "careless": 0.0, "method": method, "level": level, "level_deg": level}
    return {**place, **told, "success": success, **more}


def shown(rates: Rates, most: int) -> list[str]:
    out = io.StringIO()
    Console(file=out, width=100).print(rates.table(most))
    return [line.rstrip() for line in out.getvalue().splitlines()]


def test_rates_are_counted_by_cell() -> None:
    rates = Rates()
    for one in (
        row("paper", 1.0, True),
        row("paper", 1.0, False),
        row("paper", 2.0, True),
        row("none", 1.0, False),
        row("none", 1.0, None),
        row("none", 1.0, True, level_deg=0.5),
    ):
        rates.count(one)
    assert [line.split() for line in shown(rates, 10)] == [
        ["method", "level", "1,", "0.5", "1", "2"],
        ["none", "1/1", "0/1"],
        ["paper", "1/2", "1/1"],
    ]


def test_the_cells_of_the_last_trials_are_shown() -> None:
    rates = Rates()
    for name in ("a", "b", "c", "d", "a"):
        rates.count(row("none", 1.0, True, scenario=name))
    assert [line.split()[:3] for line in shown(rates, 2)[1:]] == [
        ["a", "none", "2/2"],
        ["d", "none", "1/1"],
        ["and", "2", "more"],
    ]


def test_without_a_terminal_a_line_a_minute_is_said(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [0.0]
    monkeypatch.setattr("apo_bench.sweeps.progress.time.monotonic", lambda: now[0])
    with progress(10) as count:
        for now[0] in (10.0, 59.0, 60.0, 100.0, 120.0):
            count(row("none", 1.0, True))
    lines = ("3 of 10 trials in 1 min, about 2 min to go\n", "5 of 10 trials in 2 min, about 2 min to go\n")
    assert capsys.readouterr() == ("", "".join(lines))


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs a terminal")
def test_a_terminal_sees_how_many_trials_are_left(monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = os.openpty()
    monkeypatch.setenv("TERM", "xterm")
    with os.fdopen(theirs, "w") as terminal:
        monkeypatch.setattr(sys, "stderr", terminal)
        with progress(3) as count:
            count(row("none", 1.0, True))
    seen = ""
    with suppress(OSError):  # how a terminal that nobody writes to any more ends
        while text := os.read(ours, 100_000):
            seen += text.decode()
    os.close(ours)
    assert "1/3" in seen
    assert "trials" in seen
