"""Estimates of robots that probe, against drawn and assumed errors, in lines, conditions and tables."""

from __future__ import annotations

import math
from typing import Any

import pytest

from apo_bench.benchmark.analysis import group_by_setting, list_settings, tabulate_probing, tally
from apo_bench.benchmark.analysis.paired import get_reference_condition
from apo_bench.benchmark.report.tables.conditions import make_condition_table
from tests.benchmark.analysis.test_rates import row


def probe(seed: int, mm: float, method: str = "contact+probe", **more: Any) -> dict[str, Any]:
    sizes = {
        "base_error_estimate_mm": mm,
        "base_error_estimate_deg": 0.1,
        "base_error_estimate_std_mm": 0.2,
        "base_error_estimate_std_deg": 0.05,
    }
    given = {"ft_sensor": "wrist", "assumed_robot_error": "matched", "robot_error": "hand_eye:0.5/0.1+tool:1"}
    return {**row(method, seed), **given, **sizes, "probe_contacts": 6 + seed, "probe_contacts_rejected": seed, **more}


def test_sizes_are_root_mean_squares_of_vectors_as_standard_deviations_are() -> None:
    (found,) = tabulate_probing([probe(0, 0.3), probe(1, 0.4), row("contact")])
    assert (found["trials"], found["probe_contacts"], found["rejected"]) == (2, 6.5, 1)
    assert found["estimated_mm"] == pytest.approx(math.sqrt((0.09 + 0.16) / 2))
    assert (found["std_mm"], found["std_deg"]) == pytest.approx((0.2, 0.05))
    assert found["drawn_mm"] == found["assumed_mm"] == pytest.approx(math.sqrt(3) * 0.5)
    assert found["drawn_deg"] == found["assumed_deg"] == pytest.approx(math.sqrt(3) * 0.1)


def test_sensors_and_stated_errors_are_cells_of_robots_that_feel_alone() -> None:
    rows = [probe(0, 0.3, ft_sensor=ft_sensor) for ft_sensor in ("joint-torque", "wrist")]
    plain = {**row("contact"), "robot_error": rows[0]["robot_error"]}
    cells = tally([*rows, plain])
    assert [(cell.method, cell.ft_sensor) for cell in cells] == [
        ("contact", "wrist"),
        ("contact+probe", "wrist"),
        ("contact+probe", "joint-torque"),
    ]
    groups = group_by_setting(list_settings(cells), cells)
    assert sorted((s.ft_sensor, tuple(cell.method for cell in own)) for s, own in groups.items()) == [
        ("joint-torque", ("contact", "contact+probe")),
        ("wrist", ("contact", "contact+probe")),
    ]
    assert ["sensor joint-torque" in s.title for s in groups] == [s.ft_sensor == "joint-torque" for s in groups]
    assert get_reference_condition(cells[2], "uncorrected").ft_sensor == "wrist"
    table = make_condition_table(cells)
    shown = [column.head for column in table.shown].index("ft_sensor")
    assert [line[shown] for line in table.lines] == ["any", "wrist", "joint-torque"]
    assert "assumed_robot_error" not in [column.head for column in table.shown]
