"""What `scenario check` finds in a scenario: each fault is said, with the line of the file that can mend it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from apo_bench.importers.assembly.contact_search import find_clashes
from apo_bench.importers.assembly.new_scenario import new_scenario
from apo_bench.importers.assembly.posed_parts import place_on_table
from apo_bench.importers.assembly.scenario_check import check_file
from apo_bench.importers.assembly.scenario_writer import write_scenario
from apo_bench.scenario.parts import load_part
from apo_bench.scenario.parts.making import bore, extrude, make_rectangle, make_shaft
from tests.importers.assembly.test_new_scenario import at, made


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Part files, and a scenario of a cube that is put on a plate."""
    folder = tmp_path_factory.mktemp("cube")
    plate = extrude(make_rectangle(80, 60), 0, 15, bottom="bottom", top="top")
    cube = extrude(make_rectangle(30, 30), 0, 30, bottom="bottom", top="top")
    places = {"plate": ("plate", at(0, 0, 0)), "cube": ("cube", at(0, 0, 15))}
    pile = new_scenario(place_on_table(made(folder, {"plate": plate, "cube": cube}, places)))
    write_scenario(pile, folder / "own.toml", "own", "a test")
    return folder


def test_all_is_well_and_the_robot_that_knows_the_truth_succeeds(folder: Path) -> None:
    findings = list(check_file(folder / "own.toml", seeds=1, fidelity="near-contact"))
    assert [finding.what for finding in findings if finding.ok] == [
        *("file", "parts", "starts", "ways", "play", "gripper", "reach", "oracle")
    ]
    assert findings[0].sentence.startswith("2 parts, 1 operations, 1 contacts (1 plane on plane)")
    assert str(findings[-1]) == "ok     oracle   1 of 1 trial in which the robot knows the true poses succeeded"


def test_a_site_that_is_too_far_is_named_with_one_in_reach(folder: Path) -> None:
    text = (folder / "own.toml").read_text(encoding="utf-8").replace("center_mm = [100, 0]", "center_mm = [400, 0]")
    path = folder / "farther.toml"
    path.write_text(text, encoding="utf-8")
    *far, place = (finding for finding in check_file(path, seeds=0) if finding.what == "reach")
    assert far[0].sentence.startswith("site: move it nearer to the arm")
    assert place.sentence.startswith("site: all is in reach with center_mm = [")
    assert place.line == far[0].line


def test_a_part_that_does_not_stand_at_its_start_is_named_with_its_line(tmp_path: Path) -> None:
    hole = extrude(make_rectangle(60, 60), 0, 20, bores=[bore((0, 0), 1.7, 0, 20, "bore")], bottom="bottom", top="top")
    thin = make_shaft(1.5, 0, 90, "side", bottom="tip", top="head")
    places = {"plate": ("plate", at(0, 0, 0)), "thin": ("thin", at(0, 0, 0))}
    path = tmp_path / "own.toml"
    tall = new_scenario(place_on_table(made(tmp_path, {"plate": hole, "thin": thin}, places)))
    start = np.array(tall.starts["thin"])
    start[2, 3] = 0.0  # beside its fixture
    write_scenario(replace(tall, fixtures={}, starts={**tall.starts, "thin": start}), path, "own", "a test")
    (wrong,) = (finding for finding in check_file(path, seeds=0) if finding.what == "starts")
    assert wrong.sentence.startswith("parts, thin, start: 'thin' does not stand like this")
    assert wrong.line is not None
    assert path.read_text(encoding="utf-8").splitlines()[wrong.line - 1].startswith("start = ")


def test_parts_inside_each_other_are_named_with_how_deep(folder: Path) -> None:
    cube = load_part(folder / "cube.xml")
    beside = {"a": at(0, 0, 0), "b": at(30.2, 0, 0)}
    assert find_clashes({"a": cube, "b": cube}, beside, clearance_mm=0.25) == []
    (sentence,) = find_clashes({"a": cube, "b": cube}, beside | {"b": at(26, 3, 2)}, clearance_mm=0.25)
    assert sentence.startswith("'a' and 'b' are 4 mm inside each other; give them room")
