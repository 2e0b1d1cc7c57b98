"""Stages of a trial exclude each other and sum to the whole; a page needs no measurement of other packages."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import speed


def test_stages_exclude_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr("benchmarks.speed.time.process_time", lambda: now[0])
    stages = speed.Stages()

    def spend(seconds: float) -> None:
        now[0] += seconds

    physics = stages.timed(spend, speed.PHYSICS, within="replay")

    def replay() -> None:
        spend(1.0)
        physics(4.0)
        spend(2.0)

    physics(8.0)  # outside a replay: of the stage that runs
    stages.timed(replay, "replay")()
    spend(16.0)
    stages.switch(speed.OTHER)
    assert stages.spent == {speed.OTHER: 24.0, "replay": 3.0, speed.PHYSICS: 4.0}
    assert sum(stages.spent.values()) == now[0]


def test_ratios_pair_the_same_trials_and_the_page_names_what_is_missing(tmp_path: Path) -> None:
    made = [
        {"checkout": i, "scenario": name, "fidelity": fidelity, "seed": seed, "simulated_s": 10.0, "success": True}
        | {"stages": {"replay": (seed + 1.0) * (1 + i), "judge": 1.0 + i}}
        for i in range(2)
        for name in speed.SCENARIOS
        for fidelity in speed.FIDELITIES
        for seed in range(3)
    ]
    assert "| stick_in_tower | full | 0.50 | 3.00 | 6.00 |" in list(speed.ratios(made, 1))
    text = "\n".join(speed.page({"trials": made, "steps": {"robosuite Lift": 40.0}, "correctors": ["a table"]}))
    assert "| robosuite Lift | 40 | 20 | 2.0 |" in text
    assert "did not install or run: gym-taskboard Pegs." in text
    speed.draw(made, tmp_path / "bars.svg")
    assert (tmp_path / "bars.svg").read_text(encoding="utf-8").count("near-contact") >= len(speed.SCENARIOS)
