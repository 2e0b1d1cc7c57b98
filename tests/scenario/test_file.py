"""Scenario files: the good ones say what they say, and every broken one is refused in one sentence."""

from __future__ import annotations

import os
import re
import shutil
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench import InputError, load_scenario
from apo_bench.geometry import pose
from apo_bench.records import Thresholds
from apo_bench.resources import folder
from apo_bench.scenario.file import scenario_names

TOWER = (folder("scenarios") / "stick_in_tower.toml").read_text()
SLOTS = (folder("scenarios") / "stick_on_castles.toml").read_text()

TABLE = '[parts.table]\nfile = "table"\nfixed = true\n'
STICK_START = "start = { at_mm = [60, 290, 10] }"
GOAL2 = "goal = { at_mm = [0, 0, 80], turn_deg = [180, 0, 0] }"
GOAL3 = "goal = { at_mm = [0, 0, 40] }"
BOTTOM = 'contacts = [["bottom", "table.top"]]'
ON_TOP = 'contacts = [["topP", "castle1.topN"], ["topN", "castle1.topP"]]'
VARY2 = 'vary = { along = "x", mm = [-4, 4] }'
CARELESS = 'operation = 2\nalong = "y"\nsize_mm = [1.5, 4.0]'

STICK_CONTACTS = TOWER[TOWER.index("contacts = [\n") : TOWER.index("]\nattach") + 1]

BROKEN = {
    "toml_line": ("schema = 1", "schema = = 1", ["TOML", "line 4"]),
    "key_twice": ("schema = 1", "schema = 1\nschema = 1", ["TOML", "line 5"]),
    "part_twice": ("\n[site]", '\n[parts.stick]\nfile = "stick"\n[site]', ["TOML", "stick"]),
    "no_schema": ("schema = 1\n", "", ["'schema' is missing"]),
    "other_schema": ("schema = 1", "schema = 2", ["schema", "schema = 1 is needed", "2 was given"]),
    "unknown_key": ("clearance_mm = 0.25", "clearence_mm = 0.25", ["'clearence_mm'", "did you mean 'clearance_mm'"]),
    "unknown_part_key": ("fixed = true", "fixd = true", ["parts, table", "'fixd'", "'fixed'"]),
    "unknown_operation_key": (VARY2, 'varry = { along = "x", mm = [-4, 4] }', ["operation 2", "'vary'"]),
    "unknown_judge_key": ("support_mm", "suport_mm", ["judge", "'support_mm'"]),
    "no_title": ('title = "A stick into the hole between two stacked castles"\n', "", ["'title' is missing"]),
    "no_goal": (GOAL2 + "\n", "", ["operation 2", "'goal' is missing"]),
    "no_start": (STICK_START, "", ["parts, stick", "'start' is missing"]),
    "title_number": (
        'title = "A stick into the hole between two stacked castles"',
        "title = 3",
        ["title", "3 was given"],
    ),
    "clearance_text": ("clearance_mm = 0.25", 'clearance_mm = "small"', ["clearance_mm", '"small" was given']),
    "clearance_negative": ("clearance_mm = 0.25", "clearance_mm = -0.1", ["clearance_mm", "-0.1 was given"]),
    "clearance_nan": ("clearance_mm = 0.25", "clearance_mm = nan", ["clearance_mm", "finite"]),
    "clearance_huge": ("clearance_mm = 0.25", "clearance_mm = 25", ["clearance_mm", "at most 5"]),
    "gap_zero": ("gap_mm = 0.1\n", "gap_mm = 0\n", ["gap_mm", "above 0"]),
    "goal_infinite": (GOAL3, "goal = { at_mm = [0, 0, inf] }", ["operation 3, goal, at_mm", "finite"]),
    "goal_two_numbers": (GOAL3, "goal = { at_mm = [0, 40] }", ["operation 3, goal, at_mm", "3 finite numbers"]),
    "goal_far": (GOAL3, "goal = { at_mm = [0, 0, 4e9] }", ["operation 3, goal, at_mm", "2000 mm"]),
    "goal_flag": (GOAL3, "goal = { at_mm = [0, 0, true] }", ["operation 3, goal, at_mm", "3 finite numbers"]),
    "turn_far": ("[180, 0, 0] }\ncontacts", "[1e5, 0, 0] }\ncontacts", ["operation 2, goal, turn_deg", "360"]),
    "unknown_part_file": ('file = "stick"', 'file = "stik"', ["parts, stick, file", "did you mean 'stick'"]),
    "named_arm": ("[parts.stick]", "[parts.arm]", ["parts, arm", "as the robot is"]),
    "title_obeyed": ("A stick into", "A \\u001b[2Jstick into", ["title", "a text without control characters"]),
    "many_parts": (
        "[site]\n",
        "".join(f'[parts.p{k}]\nfile = "block"\nfixed = true\n' for k in range(50)) + "[site]\n",
        ["at most 50 parts"],
    ),
    "many_operations": ("[site]\n", '[[operations]]\nmove = "stick"\n' * 100 + "[site]\n", ["at most 100 operations"]),
    "missing_part_file": ('file = "stick"', 'file = "own/stick.xml"', ["parts, stick, file", "No such file"]),
    "bad_part_name": ("[parts.stick]", '[parts."the.stick"]', ["'the.stick'"]),
    "unknown_moved_part": ('move = "stick"', 'move = "stik"', ["operation 3, move", "did you mean 'stick'"]),
    "unknown_face": ('["bottom", "table.top"]', '["botom", "table.top"]', ["contact 1", "face", "'bottom'"]),
    "unknown_lower_face": ('"table.top"', '"table.tip"', ["operation 1, contacts, contact 1", "face of part 'table'"]),
    "unknown_lower_part": ('"table.top"', '"tabel.top"', ["part 'tabel'", "did you mean 'table'"]),
    "face_without_part": ('"table.top"', '"top"', ["operation 1", "'part.face'"]),
    "contact_of_three": ('["bottom", "table.top"]', '["bottom", "table", "top"]', ["contact 1", "a pair is needed"]),
    "contact_twice": (BOTTOM, 'contacts = [["bottom", "table.top"], ["bottom", "table.top"]]', ["contact 2", "twice"]),
    "no_contact": (BOTTOM, "contacts = []", ["operation 1, contacts", "no contact"]),
    "own_face": ('["bottom", "table.top"]', '["bottom", "castle1.topP"]', ["'castle1' moves in this operation"]),
    "not_there_yet": ('["bottom", "table.top"]', '["bottom", "castle2.topP"]', ["'castle2' is not there yet"]),
    "other_part_above": ('["bottom", "table.top"]', '["stick.nz", "table.top"]', ["'stick' does not move here"]),
    "fixed_part_moves": ('move = "castle1"', 'move = "table"', ["operation 1, move", "'table' is fixed"]),
    "faces_apart": (GOAL2, GOAL2.replace(" 80]", " 83.2]"), ["contacts, contact 1", "3.2 mm apart", "castle2.topP"]),
    "faces_deep": (GOAL2, GOAL2.replace(" 80]", " 79]"), ["contacts, contact 1", "1 mm too deep"]),
    "faces_look_away": (ON_TOP, 'contacts = [["bottom", "castle1.topN"]]', ["contact 1", "0 degrees apart", "180"]),
    "faces_beside": (
        'contacts = [["topP", "castle1.topN"], ["topN", "castle1.topP"]]',
        'contacts = [["topP", "castle1.topP"]]',
        ["contact 1", "do not overlap"],
    ),
    "parts_overlap": (
        GOAL3 + "\n" + STICK_CONTACTS,
        'goal = { at_mm = [0, 0, 38] }\ncontacts = [["py", "castle1.spy"]]',
        ["operation 3, goal", "'stick' and 'castle1'", "2 mm inside each other"],
    ),
    "starts_overlap": (
        "at_mm = [140, -290, 40]",
        "at_mm = [40, -290, 40]",
        ["start", "'castle1' and 'castle2'", "20 mm"],
    ),
    "start_in_table": (STICK_START, STICK_START.replace("10]", "5]"), ["parts, stick, start", "5 mm inside"]),
    "start_in_the_way": (STICK_START, STICK_START.replace("60, 290", "110, 0"), ["'stick'", "inside each other"]),
    "start_in_the_way_of_a_site": (
        "spread_mm = [40, 60]",
        "spread_mm = [30, 240]",
        ["site", "inside each other", "when the site is at"],
    ),
    "turned_over": (", 40], turn_deg = [180, 0, 0] }\n", ", 0] }\n", ["operation 2, goal", "tilted by 180 degrees"]),
    "vary_along_fixed": (
        VARY2,
        'vary = { along = "z", mm = [-4, 4] }',
        ["operation 2, vary", "4 mm", "no contact fixes"],
    ),
    "vary_unknown_axis": (VARY2, 'vary = { along = "u", mm = [-4, 4] }', ["operation 2, vary, along", '"u" was given']),
    "vary_zero_axis": (VARY2, "vary = { along = [0, 0, 0], mm = [-4, 4] }", ["operation 2, vary, along", "zero"]),
    "vary_wrong_way": (
        VARY2,
        'vary = { along = "x", mm = [4, -4] }',
        ["operation 2, vary, mm", "a lowest and a highest"],
    ),
    "turn_tilts": (VARY2, 'vary = { about = "x", deg = [-4, 4] }', ["operation 2, vary", "4 degrees"]),
    "turn_off_its_place": (
        VARY2,
        'vary = { about = "z", deg = [-4, 95], at_mm = [500, 0, 0] }',
        ["operation 2, vary", "turned by"],
    ),
    "turn_wrong_way": (
        VARY2,
        'vary = { about = "z", deg = [4, -4] }',
        ["operation 2, vary, deg", "a lowest and a highest"],
    ),
    "turn_too_far": (VARY2, 'vary = { about = "z", deg = [-400, 4] }', ["operation 2, vary, deg", "-360 and 360"]),
    "turn_without_angle": (
        VARY2,
        'vary = { about = "z", mm = [-4, 4] }',
        ["operation 2, vary", "unknown key 'mm'", "about, deg, at_mm"],
    ),
    "vary_no_table": (VARY2, "vary = 4", ["operation 2, vary", "named keys"]),
    "vary_too_far": (VARY2, 'vary = { along = "x", mm = [-400, 4] }', ["operation 2, vary"]),
    "careless_operation": ("operation = 2", "operation = 4", ["careless, operation", "from 1 to 3", "4 was given"]),
    "careless_float": ("operation = 2", "operation = 2.5", ["careless, operation", "whole number"]),
    "careless_axis": (CARELESS, CARELESS.replace('"y"', '"w"'), ["careless, along", '"w" was given']),
    "careless_up": (CARELESS, CARELESS.replace('"y"', '"z"'), ["careless, along", "level"]),
    "careless_negative": ("size_mm = [1.5, 4.0]", "size_mm = [-1.5, 4.0]", ["careless, size_mm"]),
    "threshold_negative": ("pushed_mm = 1.0", "pushed_mm = -1.0", ["judge, pushed_mm", "-1.0 was given"]),
    "threshold_fraction": ("overlap_fraction = 0.5", "overlap_fraction = 50", ["judge, overlap_fraction", "at most 1"]),
    "spread_negative": ("spread_mm = [40, 60]", "spread_mm = [40, -60]", ["site, spread_mm"]),
    "yaw_wrong_way": ("yaw_deg = [-28, 28]", "yaw_deg = [28, -28]", ["site, yaw_deg", "a lowest and a highest"]),
    "site_list": ("\n[site]", "\n[[site]]", ["site", "named keys"]),
    "color": ("[0.91, 0.79, 0.33]", "[0.91, 0.79, 33]", ["parts, stick, color", "from 0 to 1"]),
    "travel_zero": ("travel_mm = 1", "travel_mm = -1", ["operation 3, attach, travel_mm", "above 0"]),
    "attach_diagonal_text": ('attach = { along = "+x"', 'attach = { along = "xy"', ["operation 3, attach, along"]),
    "grasp_outside": ("[-65, 0, 4]", "[-650, 0, 4]", ["operation 3, grasp, at_mm", "a point of the part"]),
    "grasp_upright": (
        '[-65, 0, 4], across = "y"',
        '[-65, 0, 4], across = "z"',
        ["operation 3, grasp, across", "level"],
    ),
    "follows_but_moves": ('file = "stick"', 'file = "stick"\nfollows_site = true', ["follows_site", "fixed"]),
    "carries_early": (BOTTOM, BOTTOM + '\ncarries = ["stick"]', ["operation 1, carries", "'stick'", "move it first"]),
    "carries_itself": (ON_TOP, ON_TOP + '\ncarries = ["castle2"]', ["operation 2, carries", "'castle2'"]),
    "carries_fixed": (ON_TOP, ON_TOP + '\ncarries = ["table"]', ["operation 2, carries", "'table' is fixed"]),
    "start_in_the_air": (
        STICK_START,
        "start = { at_mm = [60, 290, 22.5] }",
        ["parts, stick, start, at_mm", "'stick' starts in the air, 12.5 mm above 'table'"],
    ),
    "start_over_a_part": (STICK_START, "start = { at_mm = [0, -290, 72] }", ["32 mm above 'castle1'"]),
    "start_beside_the_table": (STICK_START, "start = { at_mm = [60, 1990, 10] }", ["with nothing below it"]),
    "idle_part": (TABLE, TABLE + '[parts.block]\nfile = "block"\nstart = { at_mm = [-200, 300, 25] }\n', ["'block'"]),
    "date": ('paper = "Example 5.1, Fig. 8 to 11"', "paper = 1992-07-07", ["paper", "1992-07-07"]),
    "operations_table": ("schema = 1", 'schema = 1\noperations = "later"\n', ["TOML"]),
}


def refused(path: str | Path) -> str:
    """The message; nothing but an InputError with one sentence may come."""
    with pytest.raises(InputError) as error:
        load_scenario(path)
    message = str(error.value)
    assert "\n" not in message
    assert message.endswith(".")
    assert "Traceback" not in message
    return message


def complaint(path: Path) -> str | None:
    """What is wrong, or None for a good file; any other exception is a fault of the reader."""
    try:
        load_scenario(path)
    except InputError as error:
        return str(error)
    return None


@pytest.mark.parametrize("fault", sorted(BROKEN))
def test_a_broken_scenario_is_refused_in_one_sentence(fault: str, tmp_path: Path):
    old, new, words = BROKEN[fault]
    assert old in TOWER
    path = tmp_path / "mine.toml"
    path.write_text(TOWER.replace(old, new, 1))
    message = refused(path)
    assert message.startswith(str(path))
    for word in words:
        assert word in message


def test_operations_may_not_be_empty(tmp_path: Path):
    path = tmp_path / "mine.toml"
    path.write_text(f'schema = 1\ntitle = "nothing"\noperations = []\n{TABLE}')
    assert "operations: the list is empty" in refused(path)
    path.write_text(f'schema = 1\ntitle = "nothing"\n{TABLE}')
    assert "'operations' is missing" in refused(path)
    path.write_text('schema = 1\ntitle = "nothing"\nparts = {}\noperations = []\n')
    assert "at least one table [parts.NAME]" in refused(path)


def test_what_is_no_text_file(tmp_path: Path):
    assert "a folder was given" in refused(tmp_path)
    assert "cannot be read" in refused(tmp_path / "none.toml")
    assert "a device was given" in refused(Path(os.devnull))
    assert "cannot be read" in refused("x" * 300 + "/y.toml")
    assert "not a path" in refused("a\0b.toml")
    path = tmp_path / "mine.toml"
    path.write_bytes(b"\xff\xfe\x00binary")
    assert "not UTF-8" in refused(path)
    path.write_bytes(b"# " + b"x" * 1_000_001)
    assert "larger than 1 MB" in refused(path)
    path.write_text("a = " + "[" * 20_000)
    assert "TOML" in refused(path)
    path.write_text("a = " + "9" * 5_000)
    assert "TOML" in refused(path)
    path.write_text("")
    assert "'schema' is missing" in refused(path)


def test_what_is_no_name():
    assert "did you mean 'stick_in_tower'" in refused("stick_in_towr")
    for wrong in (3, None, b"stick_in_tower"):
        with pytest.raises(InputError, match="given of load_scenario must be a text, a Path or a Scenario, got"):
            load_scenario(wrong)


def test_a_file_that_may_not_be_read(tmp_path: Path):
    path = tmp_path / "mine.toml"
    path.write_text(TOWER)
    path.chmod(0)
    if os.access(path, os.R_OK):
        pytest.skip("this user may read everything")
    assert "cannot be read" in refused(path)


@given(st.integers(0, len(TOWER) - 1), st.sampled_from(list("[]{}=\"'.,-+eE0123456789nani_xyz#\n ")))
@settings(max_examples=25, deadline=None)
def test_any_changed_letter_gives_a_scenario_or_one_sentence(tmp_path_factory, place: int, letter: str):
    path = tmp_path_factory.getbasetemp() / "changed.toml"
    path.write_text(TOWER[:place] + letter + TOWER[place + 1 :])
    message = complaint(path)
    assert message is None or (re.fullmatch(r"[^\n]+\.", message) and message.startswith(str(path)))


def test_the_names_of_the_package():
    assert {"stick_in_tower", "stick_on_castles"} <= set(scenario_names())
    for name in scenario_names():
        assert load_scenario(name).name == name


def test_a_short_name_is_one_object_until_a_file_of_the_package_changes(tmp_path: Path, monkeypatch):
    for name in ("scenarios", "assets/parts"):
        shutil.copytree(folder("scenarios").parent / name, tmp_path / name)
    monkeypatch.setattr("apo_bench.scenario.file.folder", lambda name: tmp_path / name)
    path = tmp_path / "scenarios" / "stick_in_tower.toml"
    first = load_scenario("stick_in_tower")
    assert load_scenario("stick_in_tower") is first
    assert load_scenario(path) is not first
    path.write_text(TOWER.replace('title = "A', 'title = "Some'))
    assert load_scenario("stick_in_tower").title.startswith("Some stick")


def test_what_the_tower_says():
    tower = load_scenario("stick_in_tower")
    assert load_scenario(tower) is tower
    assert [operation.main for operation in tower.assembly.operations] == ["castle1", "castle2", "stick"]
    assert [len(operation.contacts) for operation in tower.assembly.operations] == [1, 2, 6]
    assert tower.assembly.fixed == {"table"}
    assert str(tower.assembly.operations[1].contacts[0]) == "castle2.topP on castle1.topN"
    assert tower.goals[1] == pytest.approx(pose.at((0, 0, 0.08), (180, 0, 0)))
    assert tower.start["castle2"] == pytest.approx(pose.at((0.14, -0.29, 0.04), (180, 0, 0)))
    assert (tower.careless.operation, tower.careless.low_m, tower.careless.high_m) == (1, 0.0015, 0.004)
    assert tower.careless.axis == pytest.approx((0, 1, 0))
    assert np.degrees(tower.site.yaw_rad) == pytest.approx((-28, 28))
    assert [(s.operation, s.low_m, s.high_m) for s in tower.shifts] == [(1, -0.004, 0.004), (2, -0.005, 0.005)]
    assert tower.thresholds == Thresholds()
    assert (tower.clearance_mm, tower.gap_mm) == (0.25, 0.1)
    assert tower.colors["stick"] == (0.91, 0.79, 0.33)
    assert tower.attach[2].direction == pytest.approx((1, 0, 0))
    assert tower.grasps[2].point[0] == pytest.approx(-0.065)


def test_what_is_left_out_has_a_default(tmp_path: Path):
    """From straight above, 30 mm; held above its middle, across the narrower level axis; no site, nobody careless."""
    lines = SLOTS.split("\n[site]")[0].splitlines()
    optional = r"(grasp|vary|clearance_mm|gap_mm|paper|human|success|color) ="
    kept = [line for line in lines if not re.match(optional, line)]
    path = tmp_path / "plain.toml"
    path.write_text("\n".join(kept))
    plain = load_scenario(path)
    assert plain.name == "plain"
    assert (plain.paper, plain.human, plain.success) == ("", "", "")
    assert (plain.clearance_mm, plain.gap_mm, plain.careless, plain.shifts) == (0.25, 0.1, None, ())
    assert plain.site.spread_m == (0.0, 0.0)
    assert plain.thresholds == Thresholds()
    assert not plain.colors
    for attach in plain.attach:
        assert attach.direction == pytest.approx((0, 0, -1))
        assert attach.travel_m == 0.03
    assert plain.grasps[2].point == pytest.approx((0, 0, 0.003))
    assert plain.grasps[2].across == pytest.approx((0, 1, 0))


def test_from_above_is_in_the_frame_of_the_part():
    """Castle 2 of the tower lies upside down: down in the world is up in its own frame."""
    tower = load_scenario("stick_in_tower")
    assert tower.attach[1].direction == pytest.approx((0, 0, 1))
    assert tower.goals[1][:3, :3] @ tower.attach[1].direction == pytest.approx((0, 0, -1))


def test_every_threshold_is_read(tmp_path: Path):
    given = {field.name: 0.25 + 0.01 * k for k, field in enumerate(fields(Thresholds))}
    path = tmp_path / "mine.toml"
    path.write_text(TOWER.split("[judge]")[0] + "[judge]\n" + "\n".join(f"{k} = {v}" for k, v in given.items()))
    assert load_scenario(path).thresholds == Thresholds(**given)


def test_part_files_are_found_beside_the_scenario(tmp_path: Path):
    (tmp_path / "own").mkdir()
    source = (folder("assets") / "parts" / "stick.xml").read_text()
    (tmp_path / "own" / "rod.xml").write_text(source)
    path = tmp_path / "mine.toml"
    path.write_text(TOWER.replace('file = "stick"', 'file = "own/rod.xml"'))
    mine = load_scenario(str(path))
    assert mine.part_files["stick"] == tmp_path / "own" / "rod.xml"
    assert mine.assembly.solids["stick"].name == "rod"
    (tmp_path / "own" / "rod.xml").write_text(source.replace('name="bar"', ""))
    message = refused(path)
    assert "parts, stick, file" in message
    assert "has no name" in message


SUB_ASSEMBLY = """
schema = 1
title = "A block on a bridge, moved together, then the block alone"

[parts.table]
file = "table"
fixed = true

[parts.stop]
file = "block"
fixed = true
follows_site = true
start = { at_mm = [-75, 0, 25] }

[parts.bridge]
file = "bridge"
start = { at_mm = [0, -300, 10] }

[parts.block]
file = "block"
start = { at_mm = [0, 300, 25] }

[[operations]]
move = "bridge"
goal = { at_mm = [20, 100, 10] }
contacts = [["nz", "table.top"]]

[[operations]]
move = "block"
goal = { at_mm = [20, 100, 45] }
contacts = [["nz", "bridge.pz"]]

[[operations]]
move = "bridge"
carries = ["block"]
goal = { at_mm = [0, 0, 10] }
contacts = [["nz", "table.top"], ["nx", "stop.px"]]

[[operations]]
move = "block"
goal = { at_mm = [-75, 0, 75] }
contacts = [["nz", "stop.pz"]]
vary = [{ along = "x", mm = [-5, 5] }, { along = "y", mm = [-5, 5] }]

[site]
center_mm = [50, 0]
spread_mm = [20, 0]
yaw_deg = [-20, 20]
"""


def test_carried_parts_second_moves_and_fixed_parts_that_follow(tmp_path: Path):
    path = tmp_path / "group.toml"
    path.write_text(SUB_ASSEMBLY)
    group = load_scenario(path)
    assert group.follows_site == {"stop"}
    assert group.assembly.operations[2].moves == ("bridge", "block")
    assert [shift.operation for shift in group.shifts] == [3, 3]
    assert len(group.assembly.odls()[2]["block"]) == 3


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("follows_site = true\n", "", ["operation 3, contacts, contact 2", "50 mm apart"]),
        ('["nx", "stop.px"]', '["nx", "block.px"]', ["operation 3", "'block' moves in this operation"]),
        ('["nx", "stop.px"]', '["block.nx", "stop.px"]', ["'block.nx on stop.px'", "25 mm apart"]),
        ("[0, 0, 10] }\ncontacts", "[-10, 0, 10] }\ncontacts", ["operation 3", "10 mm too deep"]),
    ],
)
def test_broken_groups(old: str, new: str, words: list[str], tmp_path: Path):
    assert SUB_ASSEMBLY.count(old) == 1
    path = tmp_path / "group.toml"
    path.write_text(SUB_ASSEMBLY.replace(old, new))
    message = refused(path)
    for word in words:
        assert word in message


BRIDGE, FIXTURE, POCKETS = (
    (folder("scenarios") / f"{name}.toml").read_text()
    for name in ("carried_bridge", "vanished_fixture", "pocket_table")
)
AWAY = 'goal = { at_mm = [70, 140, 25] }\ncontacts = [["nz", "table.top"]]\n'
AGAIN = '\n[[operations]]\nmove = "cube"\n{goal}contacts = [["nz", "table.top"]]\n'
AWAY_TWICE = AWAY + AGAIN.format(goal="goal = { at_mm = [0, 140, 25] }\n")
STICK_IN = '\n[[operations]]\nmove = "stick"\n'

DISORDER = {
    "no_such_part": (FIXTURE, 'move = "castle2"', 'move = "castle3"', ["operation 3, move", "'castle3'", "'castle2'?"]),
    "touches_what_is_not_there": (
        BRIDGE,
        '["nz", "castle1.topP"], ["nz", "castle1.topN"]',
        '["nz", "stick.pz"]',
        ["operation 3, contacts, contact 1", "'stick' is not there yet"],
    ),
    "carried_but_never_touched": (
        FIXTURE,
        AWAY,
        'carries = ["castle1"]\n' + AWAY,
        ["operation 4, carries", "'castle1' is carried, but no contact", "'cube'", "leave it out"],
    ),
    "carried_after_the_contact_is_gone": (
        POCKETS,
        'carries = ["cube2", "cube3"]',
        'carries = ["cube2", "cube3", "cube1"]',
        ["operation 6, carries", "'cube1' is carried, but no contact that stands"],
    ),
    "carried_before_it_is_there": (
        POCKETS,
        'move = "cube3"\n',
        'move = "cube3"\ncarries = ["stick"]\n',
        ["operation 3, carries", "'stick' is carried before any operation has moved it"],
    ),
    "carries_itself": (
        POCKETS,
        'carries = ["cube2", "cube3"]',
        'carries = ["cube2", "stick"]',
        ["operation 6, carries", "'stick' would carry itself"],
    ),
    "carried_twice": (
        POCKETS,
        'carries = ["cube2", "cube3"]',
        'carries = ["cube2", "cube2"]',
        ["operation 6, carries", "'cube2' stands here twice"],
    ),
    "left_in_the_air": (
        (folder("scenarios") / "block_on_block.toml").read_text(),
        "[judge]",
        '[[operations]]\nmove = "B"\ngoal = { at_mm = [200, 0, 25] }\ncontacts = [["nz", "table.top"]]\n\n[judge]',
        ["operation 3, carries", "after it 'A' rests on nothing", "carry it along, or move it first"],
    ),
    "removed_to_where_it_is": (
        FIXTURE,
        AWAY,
        AWAY + AGAIN.format(goal="goal = { at_mm = [70, 140, 25] }\n"),
        ["operation 5, goal", "'cube' stands there already"],
    ),
    "removed_twice": (
        FIXTURE,
        AWAY,
        AWAY_TWICE,
        ["operation 5, move", "operation 4 has already taken 'cube' away", "take one of the two operations out"],
    ),
}


@pytest.mark.parametrize("fault", sorted(DISORDER))
def test_operations_that_do_not_follow_from_each_other(fault: str, tmp_path: Path):
    text, old, new, words = DISORDER[fault]
    assert text.count(old) == 1
    path = tmp_path / "mine.toml"
    path.write_text(re.sub(r"(?m)^vary = .*\n", "", text.replace(old, new)))
    message = refused(path)
    for word in words:
        assert word in message


def test_a_part_may_be_moved_often_if_each_move_is_of_use(tmp_path: Path):
    """Parked, then put down as a fixture once more; or parked and carried off; only for nothing it may not be moved."""
    text = re.sub(r"(?m)^vary = .*\n", "", FIXTURE).replace(AWAY, AWAY_TWICE)
    path = tmp_path / "mine.toml"
    stop = AGAIN.format(goal="goal = { at_mm = [-70, -55, 25] }\n")
    stop = stop.replace('["nz", "table.top"]', '["nz", "table.top"], ["py", "castle1.ny"]')
    path.write_text(text.replace(STICK_IN, stop + STICK_IN))
    refused(path)
    once = text.replace(AWAY_TWICE, AWAY)
    path.write_text(once.replace(STICK_IN, stop + STICK_IN))
    assert [operation.main for operation in load_scenario(path).assembly.operations].count("cube") == 3


@pytest.mark.parametrize("name", ["a\x01b.toml", "\udcff.toml", "a\x1b[2Jb.toml"])
def test_a_file_whose_name_a_scene_cannot_have_is_refused(name: str, tmp_path: Path):
    path = tmp_path / name
    path.write_text(TOWER, encoding="utf-8")
    assert "holds control characters; rename the file" in refused(path)
