"""A task sheet says what the scenario says."""

from __future__ import annotations

from pathlib import Path

import pytest

from apo_bench import load_scenario
from apo_bench.scenario.scenario_file import list_scenario_names
from apo_bench.viz.task_sheet import write_task_sheet
from docs.task_sheets import page

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "scenarios.md"


def test_the_operations_of_fig_6() -> None:
    text = write_task_sheet(load_scenario("pocket_table"))
    for line in (
        "3. cube3: R3 cube3 -> table (nz-top), R4 cube3 -> cube1 (px-nx)",
        "4. cube1: R5 cube1 -> table (nz-top); ends R1, R4",
        "5. stick: R6 stick -> cube2 (py-hpy, ny-hny, pz-hpz, nz-hnz), "
        "R7 stick -> cube3 (py-hpy, ny-hny, pz-hpz, nz-hnz)",
        "6. stick with cube2 and cube3: R8 cube2 -> table (nz-A_fl, px-A_px, nx-A_nx, py-A_py, "
        "ny-A_ny), R9 cube3 -> table (nz-B_fl, px-B_px, nx-B_nx, py-B_py, ny-B_ny); ends R2, R3",
    ):
        assert line in text.splitlines()


def test_parts_that_follow_a_human_error() -> None:
    lines = write_task_sheet(load_scenario("vanished_fixture")).splitlines()
    error = "operation 2 displaces cube by 1.5 to 4 mm along its y axis; castle2 (operation 3) follows"
    assert f"- Human error: {error}." in lines
    assert "follow" not in write_task_sheet(load_scenario("carried_bridge"))
    assert "- Human error: none." in write_task_sheet(load_scenario("bridge_cycle")).splitlines()


def test_what_is_particular_to_a_verdict() -> None:
    text = write_task_sheet(load_scenario("fixture_alignment"))
    assert "- Verdict: as demonstrated." in text
    assert "- Fixtures: B." in text
    assert "- Allowed gaps beyond the clearance: " in write_task_sheet(load_scenario("dovetail"))


@pytest.mark.skipif(not PAGE.exists(), reason="the documents are not part of a source archive")
def test_the_page_is_what_the_scenarios_say() -> None:
    scenarios = [load_scenario(name) for name in list_scenario_names()]
    assert PAGE.read_text(encoding="utf-8") == page(scenarios), "run: python docs/task_sheets.py"
