"""The plan of every example is that of the paper, and another motion parameter is another line of it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from apo_bench import Plan, Scenario, load_scenario
from apo_bench.assembly import Step
from apo_bench.cli import app as cli
from apo_bench.geometry import pose
from apo_bench.io import format_direction
from apo_bench.planning.insertion.operation_macros import describe_operation_macros
from apo_bench.scenario.layout import find_nominal_start
from apo_bench.scenario.scenario_file import list_scenario_names
from apo_bench.viz.plan_text import describe_plan, list_plan_lines
from tests import scenes

ROOT = Path(__file__).parents[2]
DOWN = "move-to-contact -z"
SLOT = ["insert-into-slot -z", DOWN]
INTO = ["insert-into -z", "move-to-bottom -z"]
TABLE = {
    "block_on_block": [("S -> A", [DOWN]), ("S -> A", [DOWN])],
    "bridge_cycle": [("S -> A", [DOWN]), ("S -> C", [DOWN, "slide-to-contact -x"]), ("S -> A", [DOWN])],
    "stick_on_castles": [("S -> A", [DOWN]), ("S -> A", [DOWN]), ("S -> D", SLOT)],
    "fixture_alignment": [
        ("S -> A", [DOWN]),
        ("S -> C", [DOWN, "slide-to-contact +x"]),
        ("C -> A", ["depart +x", DOWN]),
    ],
    "pocket_table": [
        ("S -> A", [DOWN]),
        ("S -> A", [DOWN]),
        ("S -> C", [DOWN, "slide-to-contact +x"]),
        ("C -> A", ["depart +x", DOWN]),
        ("S -> E", ["insert-into +x"]),
        ("A -> H", ["insert-into -z", "move-to-bottom -z"]),
    ],
    "stick_in_tower": [("S -> A", [DOWN]), ("S -> A", [DOWN]), ("S -> E", ["insert-into +x"])],
    "carried_bridge": [
        ("S -> A", [DOWN]),
        ("S -> A", [DOWN]),
        ("S -> A", [DOWN]),
        ("S -> E", ["insert-into +x"]),
        ("A -> D", SLOT),
    ],
    "vanished_fixture": [
        ("S -> A", [DOWN]),
        ("S -> A", [DOWN]),
        ("S -> C", [DOWN, "slide-to-contact +y"]),
        ("C -> A", ["depart +y", DOWN]),
        ("S -> D", SLOT),
    ],
    "dovetail": [("S -> A", [DOWN]), ("S -> E", ["insert-into +x"])],
    "gearbox": [
        ("S -> C", [DOWN, "slide-to-contact +x"]),
        *[("S -> H", INTO)] * 4,
        ("S -> A", [DOWN]),
        *[("S -> H", INTO)] * 2,
        ("H -> H", ["depart +z", *INTO]),
        ("S -> H", INTO),
    ],
    "l_bracket_on_plate": [("S -> A", [DOWN]), ("S -> H", INTO)],
    "nested_bushings": [("S -> C", [DOWN, "slide-to-contact +x"]), ("S -> H", INTO), ("S -> H", INTO)],
    "peg_in_hole": [("S -> A", [DOWN]), ("S -> H", INTO)],
    "shaft_through_brackets": [("S -> A", [DOWN]), ("S -> E", ["insert-into +x"])],
    "wedge_under_roof": [
        ("S -> C", [DOWN, "slide-to-contact +y"]),
        ("S -> F", [DOWN, "slide-to-contact +y", "slide-to-contact +x"]),
    ],
}
"""Every operation of every example: state before and after, and the macros, directions in the frame of the assembly."""
LENGTHS_MM = {
    ("stick_in_tower", 3): 140.0,
    ("carried_bridge", 4): 135.0,
    ("carried_bridge", 5): 10.0,
    ("pocket_table", 5): 195.0,
    ("pocket_table", 6): 6.0,
    ("stick_on_castles", 3): 10.0,
    ("vanished_fixture", 5): 10.0,
    ("dovetail", 2): 120.0,
    ("l_bracket_on_plate", 2): 18.516,
    ("nested_bushings", 2): 35.0,
    ("nested_bushings", 3): 60.0,
    ("peg_in_hole", 2): 40.0,
    ("shaft_through_brackets", 2): 123.016,
}
LENGTHS_MM |= {("gearbox", axle): 10.016 for axle in (2, 4, 7, 9)}
LENGTHS_MM |= {("gearbox", disc): 39.016 for disc in (3, 5, 8)} | {("gearbox", 10): 17.016}
TURNING = {("peg_in_hole", 2): (1, 1, 4), ("shaft_through_brackets", 2): (2, 0, 4)}
TURNING |= {("nested_bushings", 2): (1, 1, 4), ("nested_bushings", 3): (1, 1, 4)}
TURNING |= {("gearbox", k): (1, 1, 4) for k in (2, 3, 4, 5, 7, 8, 9)}
"""Of shafts, which turn in their bores, where the faces of the letter alone leave no turn."""
SCREWS = {"A": (3, 3, 0), "C": (1, 5, 0), "D": (1, 2, 3), "E": (1, 0, 5), "F": (0, 6, 0), "H": (0, 1, 5)}


def nominal(scenario: Scenario) -> Plan:
    return Plan(scenario.assembly, scenario.start, scenario.nominal_poses)


def unstated(scenario: Scenario) -> list[tuple[str, list[str]]]:
    """States and macros found without any stated line of attach."""
    found = describe_operation_macros(scenario.assembly, find_nominal_start(scenario), scenario.nominal_poses)
    return [
        (
            f"{each.before.state.letter} -> {each.after.state.letter}",
            [f"{m.name} {format_direction(m.direction)}" for m in (*each.before.departs, *each.after.macros)],
        )
        for each in found
    ]


def test_the_table_covers_every_scenario() -> None:
    assert set(TABLE) == set(list_scenario_names())


@pytest.mark.parametrize("name", TABLE)
def test_states_and_macros_of_every_operation(name: str) -> None:
    scenario = load_scenario(name)
    form = describe_plan(list_plan_lines(nominal(scenario), scenario), scenario)
    found = [
        (
            f"{step['before']['letter']} -> {step['after']['letter']}",
            [f"{m['name']} {format_direction(np.array(m['direction']))}" for m in step["macros"]],
        )
        for step in form["steps"]
    ]
    assert found == TABLE[name]
    assert unstated(scenario) == TABLE[name], "stated lines of attach tell nothing new"
    for step in form["steps"]:
        inserted = [m["length_mm"] for m in step["macros"] if m["name"].startswith("insert")]
        assert inserted == pytest.approx([LENGTHS_MM.get((name, step["operation"]))] * len(inserted), abs=1e-3)
        assert step["line"]["free"]
        assert tuple(step["after"]["screw"]) == TURNING.get((name, step["operation"]), SCREWS[step["after"]["letter"]])
        axes = [len(step[kind]) for kind in ("position", "guarded", "walls")]
        assert axes == step["after"]["translation"], "every axis is settled in one way"


@pytest.mark.parametrize("name", ["stick_in_tower", "fixture", "pockets"])
def test_plans_do_not_depend_on_the_frame(name: str) -> None:
    """Turned and shifted on the table, the same macros in the same directions of the parts; also a little askew."""
    scene = scenes.ALL[name]()
    rng = np.random.default_rng(3)
    straight = describe_operation_macros(scene.assembly, scene.start, scene.nominal_poses)
    for _ in range(2):
        turn = scenes.turned(scene, pose.at(rng.uniform(-0.3, 0.3, 3) * (1, 1, 0), (0, 0, rng.uniform(-180, 180))))
        found = describe_operation_macros(turn.assembly, turn.start, turn.nominal_poses)
        askew = scenes.noisy(scene.nominal_poses, rng, 1.0, 1.0)
        seen = describe_operation_macros(scene.assembly, scene.start, askew, angle_rad=np.radians(10.0))
        for a, b, c in zip(straight, found, seen, strict=True):
            assert a.names == b.names == c.names
            assert a.after.state == b.after.state == c.after.state
            assert b.after.line.travel_m == a.after.line.travel_m
            np.testing.assert_allclose(b.after.line.direction, a.after.line.direction, atol=1e-9)
            for m, n in zip(a.after.macros, b.after.macros, strict=True):
                np.testing.assert_allclose(
                    b.after.to_part_frame(n.direction), a.after.to_part_frame(m.direction), atol=1e-9
                )


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    capsys.readouterr()
    code = cli.main(arguments)
    out, err = capsys.readouterr()
    return code, out, err


def test_the_page_on_plans_shows_what_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    page = (ROOT / "docs" / "how" / "plans.md").read_text(encoding="utf-8")
    assert run(capsys, "inspect", "plan", "pocket_table")[1] in page


def test_trouble_is_said(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """A stick in a hole with a block before each end: it cannot be there, or no way leads there."""
    block = '[parts.{0}]\nfile = "block"\nfixed = true\nstart = {{ at_mm = [{1}, 0, 25] }}\n'
    text = 'schema = 1\ntitle = "own"\n[parts.table]\nfile = "table"\nfixed = true\n'
    text += '[parts.stick]\nfile = "stick"\nstart = { at_mm = [0, 320, 10] }\n'
    text += '[parts.cube]\nfile = "cube"\nfixed = true\nstart = { at_mm = [0, 0, 25] }\n'
    hole = '["py", "cube.hpy"], ["ny", "cube.hny"], ["pz", "cube.hpz"], ["nz", "cube.hnz"]'
    for at, more, words in (
        (135, ', ["px", "a.nx"], ["nx", "b.px"]', "operation 1 (stick): locked"),
        (180, "", "operation 1 (stick): no free insertion axis"),
    ):
        path = tmp_path / "own.toml"
        operation = f'[[operations]]\nmove = "stick"\ngoal = {{ at_mm = [0, 0, 25] }}\ncontacts = [{hole}{more}]\n'
        path.write_text(text + block.format("a", at) + block.format("b", -at) + operation, encoding="utf-8")
        code, out, err = run(capsys, "inspect", "plan", str(path))
        assert (code, err) == (0, "")
        assert words in out
        code, out, _ = run(capsys, "inspect", "plan", str(path), "--json")
        assert json.loads(out)["steps"][0]["trouble"] in out


def test_undoing_reverses_the_macros() -> None:
    """Example 5.3: the cube goes back against castle 2, so undoing its departure is the sliding that put it there."""
    scenario = load_scenario("vanished_fixture")
    goals = scenario.nominal_poses
    schedule = (*(Step(k) for k in range(5)), Step(4, True), Step(3, True))
    plan = Plan(scenario.assembly, scenario.start, goals, schedule)
    *_, stick, cube = list_plan_lines(plan, scenario)
    assert [m.name for m in stick.macros] == ["depart"]
    assert format_direction(stick.macros[0].direction) == "+z"
    assert [(m.name, format_direction(m.direction)) for m in cube.macros] == [
        ("move-to-contact", "-z"),
        ("slide-to-contact", "-y"),
    ]
    assert (cube.came_from, cube.back_to, cube.target) == ("T4", "T2", None)


def test_a_plan_for_a_robot_is_written_in_the_frames_that_were_stated(tmp_path: Path) -> None:
    out = tmp_path / "robot.json"
    frames = tmp_path / "robot.toml"
    frames.write_text('schema = "apo-bench/robot/1"\nquaternion = "wxyz"\n', encoding="utf-8")
    seen = [
        "inspect",
        "plan",
        "stick_in_tower",
        "--method",
        "contact",
        "--observation",
        str(ROOT / "docs" / "seen.csv"),
    ]
    assert cli.main([*seen, "--robot-plan", str(out), "--frames", str(frames)]) == 0
    found = json.loads(out.read_text(encoding="utf-8"))
    assert found["poses"]["quaternion"] == "wxyz"
    assert [step["part"] for step in found["steps"]] == ["castle1", "castle2", "stick"]
    assert cli.main([*seen, "--robot-plan", str(out), "--frames", str(frames), "--ft-sensor", "joint-torque"]) == 0
    with_probing = json.loads(out.read_text(encoding="utf-8"))
    assert with_probing.pop("probing")["sensor"]["noise_n"] == 3.5
    assert with_probing == found
