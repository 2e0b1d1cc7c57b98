"""A task sheet says what the scenario says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from apo_bench import load_scenario
from apo_bench.scenario.file import list_scenario_names
from apo_bench.viz.task_sheet import task_sheet
from benchmarks.baselines import describe, describe_nominal, read_counts
from docs.task_sheets import page

JUDGE = Path(__file__).parents[2] / "docs" / "how" / "judge.md"
PAGE = Path(__file__).parents[2] / "docs" / "reference" / "scenarios.md"


def test_the_operations_of_fig_6() -> None:
    text = task_sheet(load_scenario("pocket_table"))
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
    text = task_sheet(load_scenario("vanished_fixture"))
    assert (
        "operation 2 displaces cube by 1.5 to 4 mm along its y axis, to either side; castle2 (operation 3) follows;"
        in text
    )
    assert "follow" not in task_sheet(load_scenario("carried_bridge"))
    assert "The scenario states no human error." in task_sheet(load_scenario("bridge_cycle"))


def test_numbers_are_those_of_the_scenario() -> None:
    scenario = load_scenario("stick_in_tower")
    text = task_sheet(replace(scenario, clearance_mm=0.4, thresholds=replace(scenario.thresholds, displaced_mm=7.0)))
    assert "at 0.4 mm clearance per side: fit margin mm 0.1, " in text
    assert ", displaced mm 7, " in text
    assert "x 120 ± 40 mm, y 0 ± 60 mm, turned by -28 to 28 degrees" in text
    assert "- Operation 2: castle2 by -4 to 4 mm along its x axis." in text


@pytest.mark.parametrize("name", ["gearbox", "pocket_table"])
def test_every_scenario_says_all_of_it(name: str) -> None:
    scenario = load_scenario(name)
    text = task_sheet(scenario)
    heads = [line for line in text.splitlines() if line.startswith("## ")]
    assert heads == ["## Parts", "## Operations", "## Human", "## Variations", "## Success"]
    for words in (scenario.title, scenario.paper, scenario.human, scenario.success):
        assert words
        assert words in text
    assert [line.split()[0] for line in text.splitlines() if line.split(". ")[0].isdigit()] == [
        f"{k + 1}." for k in range(len(scenario.assembly))
    ]


@pytest.mark.skipif(not PAGE.exists(), reason="the documents are not part of a source archive")
def test_the_page_is_what_the_scenarios_say() -> None:
    scenarios = [load_scenario(name) for name in list_scenario_names()]
    measured = {scenario.name: describe(scenario, read_counts()) for scenario in scenarios}
    assert PAGE.read_text(encoding="utf-8") == page(scenarios, measured), "run: python docs/task_sheets.py"
    assert describe_nominal(scenarios, read_counts()) in JUDGE.read_text(encoding="utf-8"), (
        "run: python docs/task_sheets.py"
    )
