"""The robot carries out macros that no shipped example has, and finds contacts by force where the plan is wrong."""

from pathlib import Path

import numpy as np
import pytest

from apo_bench import Plan, Scenario, build_scene, draw_layout, load_scenario
from apo_bench.assembly import Step
from apo_bench.geometry import pose
from apo_bench.scenario.attach_lines import list_nominal_operations
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.trial.trial_stages import Attempt, replay_and_judge

CUBE = (Path(__file__).parents[2] / "assets" / "parts" / "cube.xml").read_text(encoding="utf-8")
BOTTOM = '<geom name="end" pos="0.0225 0 0" size="0.0025 0.01 0.01"/><site name="bottom" pos="0.02 0 0"/>'
SITE = "[site]\ncenter_mm = [80, 0]\nspread_mm = [10, 10]\nyaw_deg = [-20, 20]\n"
HOLE = '["py", "{0}.hpy"], ["ny", "{0}.hny"], ["pz", "{0}.hpz"], ["nz", "{0}.hnz"]'


def own(folder: Path, *operations: str, **parts: tuple[str, tuple[float, float, float]]) -> Scenario:
    """A stick on a table, and fixed parts: file and place [mm]."""
    (folder / "blind.xml").write_text(CUBE.replace('<site name="px"', BOTTOM + '<site name="px"'), encoding="utf-8")
    text = 'schema = 1\ntitle = "own"\n[parts.table]\nfile = "table"\nfixed = true\n'
    text += '[parts.stick]\nfile = "stick"\nstart = { at_mm = [0, 320, 10] }\n'
    for name, (file, at) in parts.items():
        text += (
            f'[parts.{name}]\nfile = "{file}"\nfixed = true\nfollows_site = true\nstart = {{ at_mm = {list(at)} }}\n'
        )
    text += "".join(f'[[operations]]\nmove = "stick"\n{operation}\n' for operation in operations)
    path = folder / "own.toml"
    path.write_text(text + SITE, encoding="utf-8")
    return load_scenario(path)


def done(
    scenario: Scenario, off_mm: tuple[float, float, float] = (0, 0, 0), schedule: tuple[Step, ...] = ()
) -> Attempt:
    """Carried out at the truth, or beside it in the frame of the part."""
    scene = build_scene(scenario)
    layout = draw_layout(scenario, np.random.default_rng(1), scene.clearance_mm)
    goals = layout.poses @ pose.at(1e-3 * np.array(off_mm))
    plan = Plan(scenario.assembly, layout.start, goals, schedule)
    return replay_and_judge(plan, scene, layout.poses, config=ExecutionConfig("near-contact"))


def names(scenario: Scenario) -> list[list[str]]:
    return [list(each.names) for each in list_nominal_operations(scenario)]


@pytest.mark.parametrize("short_mm", [1.0, -2.0])
def test_a_bottom_is_found_by_force(tmp_path: Path, short_mm: float) -> None:
    """Through one cube into a blind hole: pushed on until the bottom is met, also where it was planned elsewhere."""
    contacts = f'{HOLE.format("cube")}, {HOLE.format("holder")}, ["px", "holder.bottom"]'
    holes = {"cube": ("cube", (-30, 0, 25)), "holder": ("blind.xml", (60, 0, 25))}
    scenario = own(tmp_path, f"goal = {{ at_mm = [-30, 0, 25] }}\ncontacts = [{contacts}]", **holes)
    assert names(scenario) == [["insert-into", "move-to-bottom"]]
    assert done(scenario, (-short_mm, 0, 0)).verdict.as_demonstrated


def test_undoing_puts_a_stick_back_into_its_hole(tmp_path: Path) -> None:
    """Pulled out, put on the table, put back into the hole, pulled out once more: macros reversed and repeated."""
    scenario = own(
        tmp_path,
        f"goal = {{ at_mm = [0, 0, 25] }}\ncontacts = [{HOLE.format('cube')}]",
        'goal = { at_mm = [0, 120, 10] }\ncontacts = [["nz", "table.top"]]',
        cube=("cube", (0, 0, 25)),
    )
    assert names(scenario) == [["insert-into"], ["depart", "move-to-contact"]]
    assert done(scenario, schedule=(Step(0), Step(1), Step(1, True), Step(1))).verdict.as_demonstrated


def test_a_corner_is_found_by_force_from_both_sides(tmp_path: Path) -> None:
    """Into the corner, out of it sideways and away, back into it, and away again; planned 2 mm inside of the walls."""
    text = 'schema = 1\ntitle = "own"\n[parts.table]\nfile = "table"\nfixed = true\n'
    for name, x, y in (("left", 75, 0), ("back", 0, 50)):
        text += f'[parts.{name}]\nfile = "bridge"\nfixed = true\nfollows_site = true\n'
        text += f"start = {{ at_mm = [{x}, {y}, 10] }}\n"
    text += '[parts.block]\nfile = "block"\nstart = { at_mm = [0, 320, 25] }\n'
    text += '[[operations]]\nmove = "block"\ngoal = { at_mm = [0, 0, 25] }\n'
    text += 'contacts = [["px", "left.nx"], ["py", "back.ny"], ["nz", "table.top"]]\n'
    text += '[[operations]]\nmove = "block"\ngoal = { at_mm = [0, -150, 25] }\ncontacts = [["nz", "table.top"]]\n'
    (tmp_path / "own.toml").write_text(text + SITE, encoding="utf-8")
    scenario = load_scenario(tmp_path / "own.toml")
    slides = ["slide-to-contact", "slide-to-contact"]
    assert names(scenario) == [["move-to-contact", *slides], ["depart", "depart", "move-to-contact"]]
    schedule = (Step(0), Step(1), Step(1, True), Step(1))
    tried = done(scenario, (2.0, 2.0, 0), schedule)
    assert tried.result.outcome.code == "ok"
    assert [
        c.contact.environment.part for c in tried.verdict.demonstrated.contacts if c.operation == 0 and c.strict
    ] == ["left", "back", "table"]
