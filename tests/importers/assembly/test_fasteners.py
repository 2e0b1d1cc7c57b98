"""Fasteners are recognised by name or by thread, left out, and what only they hold is clamped where it is placed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from apo_bench import build_scene, draw_layout, load_scenario, replay, run_trial
from apo_bench.assembly import Plan
from apo_bench.importers.assembly.choices import AssemblyChoices
from apo_bench.importers.assembly.fasteners import find_fasteners
from apo_bench.importers.assembly.from_cad import import_parts
from apo_bench.importers.assembly.new_scenario import NoAssemblyOrder
from apo_bench.importers.assembly.posed_parts import read_posed
from apo_bench.importers.assembly.scenario_writer import write_scenario
from apo_bench.importers.assembly.up_axis import new_upright_scenario
from apo_bench.importers.cad.part_import import read_raw_solids
from apo_bench.importers.cad.solids import RawSolid
from apo_bench.scenario.parts.making import extrude, join, make_rectangle
from apo_bench.simulation.execution import ExecutionConfig
from tests.importers.assembly.test_blocked import made
from tests.importers.cad.made import block, rod, write_stl

UP = AssemblyChoices("z")
SCREW = rod(2, 16, (0, 0, 14)) + rod(3.5, 4, (0, 0, 30))
PLATE = block(60, 50, 20) - rod(1.65, 10, (0, 0, 10))
COVER = block(60, 50, 10, (0, 0, 20)) - rod(2.25, 10, (0, 0, 20))


def files(folder: Path, **solids: object) -> list[Path]:
    return [write_stl(solid, folder / f"{name}.stl") for name, solid in solids.items()]


def raws(folder: Path, **solids: object) -> list[RawSolid]:
    return [raw for path in files(folder, **solids) for raw in read_raw_solids(path, "mm")[1]]


@pytest.mark.parametrize(
    ("name", "is_one"),
    [
        *((name, True) for name in ("M4x10", "ISO 4762-M3", "washer_2", "hex nut", "cap-screw", "brass insert")),
        *((name, False) for name in ("peanut", "insert_plate", "dowel", "housing", "walnut")),
    ],
)
def test_fasteners_are_recognised_by_name(name: str, is_one: bool, tmp_path: Path) -> None:
    plate, cover, pin = raws(tmp_path, plate=PLATE, cover=COVER, pin=rod(2, 8, (50, 0, 0)))
    found = find_fasteners([plate, cover, replace(pin, name=name)])
    assert list(found) == ([2] if is_one else [])


def test_a_headed_shank_that_overlaps_a_hole_as_a_thread_does_is_a_fastener(tmp_path: Path) -> None:
    assert list(find_fasteners(raws(tmp_path, plate=PLATE, cover=COVER, a=SCREW))) == [2]
    bolt = rod(1.6, 16, (0, 0, 14)) + rod(3.5, 4, (0, 0, 30))  # it has play in the hole
    assert find_fasteners(raws(tmp_path, plate=PLATE, cover=COVER, a=bolt)) == {}
    assert find_fasteners(raws(tmp_path, plate=PLATE, nut=SCREW)) == {}, "nothing would be left to assemble"


def test_fasteners_are_left_out_and_what_they_touch_is_marked(tmp_path: Path) -> None:
    given = files(tmp_path, plate=PLATE, cover=COVER, a=SCREW, lid=block(20, 20, 5, (20, 0, 30)))
    poses, lines, _ = import_parts(given, tmp_path / "parts", "mm")
    assert {each.name: each.held for each in read_posed(poses)} == {"plate": True, "cover": True, "lid": False}
    assert any(line.startswith("a: a fastener (its shank overlaps a hole") for line in lines)
    poses, _, _ = import_parts(given, tmp_path / "all", "mm", AssemblyChoices(fasteners="parts"))
    assert {each.name for each in read_posed(poses)} == {"plate", "cover", "a", "lid"}


def test_a_solid_is_skipped_as_asked_and_one_that_makes_no_part_is_left_out(tmp_path: Path) -> None:
    ball = tmp_path / "ball.stl"
    trimesh.creation.icosphere(3, 5.0).apply_translation((0, 0, 60)).export(ball)
    given = [*files(tmp_path, plate=PLATE, cover=COVER, lid=block(20, 20, 5, (20, 0, 30))), ball]
    poses, lines, _ = import_parts(given, tmp_path / "parts", "mm", AssemblyChoices(skip=("lid",)))
    assert {each.name for each in read_posed(poses)} == {"plate", "cover"}
    assert {line for line in lines if "left out" in line} == {
        "lid is left out, as asked",
        "ball is left out: no face of the part is flat or round, so it can touch nothing; draw one that is.",
    }


@pytest.fixture(scope="module")
def hanging(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plate on the upright side of a wall, above the floor, held by screws that are no parts."""
    folder = tmp_path_factory.mktemp("hanging")
    wall = join(
        extrude(make_rectangle(80, 60), 0, 10, bottom="bottom", top="top"),
        extrude(make_rectangle(20, 60, (-30, 0)), 10, 70, top="head"),
    )
    plate = extrude(make_rectangle(10, 76), 0, 40, bottom="foot", top="top")
    parts = made(folder, wall=(wall, (0, 0, 0)), plate=(plate, (-15, 0, 25)))
    with pytest.raises(NoAssemblyOrder, match="nothing is below 'plate' that would carry it"):
        new_upright_scenario(parts, replace(UP, fasteners="parts"))
    (note,) = new_upright_scenario(parts, UP).notes
    assert note.startswith("nothing carries 'plate' at its place, and no fastener is drawn")
    found = new_upright_scenario(tuple(replace(each, held=each.name == "plate") for each in parts), UP)
    write_scenario(found, folder / "own.toml", "own", "a test")
    return folder / "own.toml"


def test_what_only_fasteners_hold_comes_against_its_seat_and_is_clamped(hanging: Path) -> None:
    (operation,) = load_scenario(hanging).assembly.operations
    assert operation.clamped
    assert "attach = { along = [-1, 0, 0] }" in hanging.read_text(encoding="utf-8")
    assert run_trial(str(hanging), method="oracle", seed=0, fidelity="near-contact")["success"]


@pytest.mark.parametrize(("before_mm", "is_clamped"), [(0.3, True), (20.0, False)])
def test_a_part_is_clamped_if_its_seat_is_felt_at_the_goal_or_a_little_beyond(
    hanging: Path, before_mm: float, is_clamped: bool
) -> None:
    scenario = load_scenario(hanging)
    layout = draw_layout(scenario, np.random.default_rng(0))
    goals = np.array(layout.poses)
    goals[0, :3, 3] += 1e-3 * before_mm * layout.poses[0, :3, 0]  # before the wall
    reached = replay(
        Plan(scenario.assembly, layout.start, goals), build_scene(scenario), config=ExecutionConfig("near-contact")
    )
    assert reached.reached.final is not None
    assert (reached.reached.final.poses["plate"][2, 3] > 0.02) == is_clamped, "else it falls onto the floor"
