"""What a sweep shows while it runs: on a terminal a bar, elsewhere a line at once and then one a minute."""

from __future__ import annotations

import pytest

from apo_bench.benchmark.sweeps.progress import show_progress


def test_without_a_terminal_a_line_a_minute_is_said(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [0.0]
    monkeypatch.setattr("apo_bench.benchmark.sweeps.progress.time.monotonic", lambda: now[0])
    with show_progress(10) as count:
        for now[0] in (10.0, 59.0, 60.0, 100.0, 120.0):
            count()
    lines = ("3 of 10 trials in 1 min, about 2 min to go\n", "5 of 10 trials in 2 min, about 2 min to go\n")
    assert capsys.readouterr() == ("", "0 of 10 trials\n" + "".join(lines))
