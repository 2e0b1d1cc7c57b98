"""Scenario files: the good ones say what they say, and broken ones are refused in one sentence."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from apo_bench import InputError, load_scenario
from apo_bench.geometry import pose
from apo_bench.records import Thresholds
from apo_bench.resources import folder

TOWER = (folder("scenarios") / "stick_in_tower.toml").read_text()
SLOTS = (folder("scenarios") / "stick_on_castles.toml").read_text()
BRIDGE, FIXTURE, POCKETS, BLOCKS = (
    (folder("scenarios") / f"{name}.toml").read_text()
    for name in ("carried_bridge", "vanished_fixture", "pocket_table", "block_on_block")
)
STICK_START = "start = { at_mm = [60, 290, 10] }"
GOAL3 = "goal = { at_mm = [0, 0, 40] }"
ON_TOP = 'contacts = [["topP", "castle1.topN"], ["topN", "castle1.topP"]]'
VARY2 = 'vary = { along = "x", mm = [-4, 4] }'
STICK_CONTACTS = TOWER[TOWER.index("contacts = [\n") : TOWER.index("]\nattach") + 1]

BROKEN = {
    "syntax": ("schema = 1", "schema = = 1", ["this is not TOML", "line 4"]),
    "another schema": ("schema = 1", "schema = 2", ["schema: 1 is needed, 2 was given"]),
    "an unknown key": ("clearance_mm = 0.25", "clearence_mm = 0.25", ["'clearence_mm'", "did you mean 'clearance_mm'"]),
    "far away": (GOAL3, "goal = { at_mm = [0, 0, 4e9] }", ["operation 3, goal, at_mm 3", "2000"]),
    "an unknown part file": ('file = "stick"', 'file = "stik"', ["parts, stick", "did you mean 'stick'"]),
    "a fixed part that moves": ('move = "castle1"', 'move = "table"', ["operation 1, move", "'table' is fixed"]),
    "an idle part": ("\n[site]", '\n[parts.cube]\nfile = "cube"\nstart = { at_mm = [0, 300, 25] }\n[site]', ["'cube'"]),
    "faces look away": (ON_TOP, 'contacts = [["bottom", "castle1.topN"]]', ["contact 1", "0 degrees apart", "180"]),
    "parts overlap": (
        GOAL3 + "\n" + STICK_CONTACTS,
        'goal = { at_mm = [0, 0, 38] }\ncontacts = [["py", "castle1.spy"]]',
        ["operation 3, goal", "'stick' and 'castle1'", "2 mm inside each other"],
    ),
    "in the way of a site": ("spread_mm = [40, 60]", "spread_mm = [30, 240]", ["site", "when the site is at"]),
    "turned over": (", 40], turn_deg = [180, 0, 0] }\n", ", 0] }\n", ["operation 2, goal", "tilted by 180 degrees"]),
    "vary along what is fixed": (VARY2, VARY2.replace('"x"', '"z"'), ["operation 2, vary", "varied by -4 mm"]),
    "a grasp outside": ("[-65, 0, 4]", "[-650, 0, 4]", ["operation 3, grasp, at_mm", "a point of the part"]),
    "starts in the air": (STICK_START, STICK_START.replace("10]", "22.5]"), ["stick, start", "12.5 mm above 'table'"]),
}


def refused(path: str | Path) -> str:
    """The message of one sentence."""
    with pytest.raises(InputError) as error:
        load_scenario(path)
    message = str(error.value)
    assert "\n" not in message
    assert message.endswith(".")
    return message


@pytest.mark.parametrize("fault", BROKEN)
def test_a_broken_scenario_is_refused_in_one_sentence(fault: str, tmp_path: Path):
    old, new, words = BROKEN[fault]
    assert old in TOWER
    path = tmp_path / "mine.toml"
    path.write_text(TOWER.replace(old, new, 1))
    message = refused(path)
    assert message.startswith(str(path))
    for word in words:
        assert word in message


def test_what_is_no_scenario_file(tmp_path: Path):
    assert "a folder was given" in refused(tmp_path)
    assert "cannot be read" in refused(tmp_path / "none.toml")
    path = tmp_path / "mine.toml"
    path.write_bytes(b"\xff\xfe\x00binary")
    assert "not UTF-8" in refused(path)
    path.write_text("")
    assert "'schema' is missing" in refused(path)
    assert "did you mean 'stick_in_tower'" in refused("stick_in_towr")
    for wrong in (3, None, b"stick_in_tower"):
        with pytest.raises(InputError, match="given of load_scenario must be a text, a Path or a Scenario, got"):
            load_scenario(wrong)
    odd = tmp_path / "a\x1b[2Jb.toml"
    odd.write_text(TOWER, encoding="utf-8")
    assert "holds control characters; rename the file" in refused(odd)


def test_what_the_tower_says():
    tower = load_scenario("stick_in_tower")
    assert load_scenario(tower) is tower
    assert [operation.main for operation in tower.assembly.operations] == ["castle1", "castle2", "stick"]
    assert [len(operation.contacts) for operation in tower.assembly.operations] == [1, 2, 6]
    assert tower.assembly.fixed == {"table"}
    assert tower.nominal_poses[1] == pytest.approx(pose.at((0, 0, 0.08), (180, 0, 0)))
    assert tower.start["castle2"] == pytest.approx(pose.at((0.14, -0.29, 0.04), (180, 0, 0)))
    assert (tower.human_error.operation, tower.human_error.low_m, tower.human_error.high_m) == (1, 0.0015, 0.004)
    assert tower.human_error.axis == pytest.approx((0, 1, 0))
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
    assert (plain.clearance_mm, plain.gap_mm, plain.human_error, plain.shifts) == (0.25, 0.1, None, ())
    assert plain.site.spread_m == (0.0, 0.0)
    assert plain.thresholds == Thresholds()
    assert not plain.colors
    for attach in plain.attach:
        assert attach.direction == pytest.approx((0, 0, -1))
        assert attach.travel_m == 0.03
    assert plain.grasps[2].point == pytest.approx((0, 0, 0.003))
    assert plain.grasps[2].across == pytest.approx((0, 1, 0))


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
    assert "parts, stick" in refused(path)


AWAY = 'goal = { at_mm = [70, 140, 25] }\ncontacts = [["nz", "table.top"]]\n'
AGAIN = '\n[[operations]]\nmove = "cube"\ngoal = { at_mm = [70, 140, 25] }\ncontacts = [["nz", "table.top"]]\n'
LEFT = '[[operations]]\nmove = "B"\ngoal = { at_mm = [200, 0, 25] }\ncontacts = [["nz", "table.top"]]\n\n[judge]'
DISORDER = {
    "carried but never touched": (
        FIXTURE,
        AWAY,
        'carries = ["castle1"]\n' + AWAY,
        ["operation 4, carries", "'castle1' is carried, but no contact", "'cube'", "leave it out"],
    ),
    "left in the air": (BLOCKS, "[judge]", LEFT, ["operation 3, carries", "after it 'A' rests on nothing"]),
    "removed to where it is": (FIXTURE, AWAY, AWAY + AGAIN, ["operation 5, goal", "'cube' stands there already"]),
}


@pytest.mark.parametrize("fault", DISORDER)
def test_operations_that_do_not_follow_from_each_other(fault: str, tmp_path: Path):
    text, old, new, words = DISORDER[fault]
    assert text.count(old) == 1
    path = tmp_path / "mine.toml"
    path.write_text(re.sub(r"(?m)^vary = .*\n", "", text.replace(old, new)))
    message = refused(path)
    for word in words:
        assert word in message
