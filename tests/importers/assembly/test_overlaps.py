"""Overlaps that no face explains are cut off pieces; a part that a small shift would free is named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from manifold3d import Manifold

import apo_bench
from apo_bench.geometry import measure_intrusion, pose, shrink_pieces
from apo_bench.importers.assembly.from_cad import import_parts
from apo_bench.importers.assembly.misplaced import describe_overlap, list_misplaced
from apo_bench.importers.assembly.posed_parts import PosedPart, read_posed
from apo_bench.scenario.parts.making import bore, extrude, make_rectangle, make_shaft
from tests.importers.assembly.test_blocked import made
from tests.importers.cad.made import block, write_stl

STAND = block(60, 50, 10) + block(10, 50, 30, (-25, 0, 10))
LUG = block(20, 20, 20, (-9, 0, 10)) + Manifold.sphere(3, 24).translate((-17.3, 0, 20))


def test_a_bump_inside_a_wall_is_cut_off_with_the_clearance_and_the_scenario_states_it(tmp_path: Path) -> None:
    files = [write_stl(solid, tmp_path / f"{name}.stl") for name, solid in (("stand", STAND), ("lug", LUG))]
    poses, lines, notes = import_parts(files, tmp_path / "parts", "mm")
    assert set(notes) <= set(lines)
    (line,) = (note for note in notes if "no whole face explains it" in note)
    assert line.startswith("'stand' and 'lug' are 0.3 mm inside each other as drawn")
    assert "mm^3 of 'lug' are taken off, which leaves 0.25 mm of play" in line
    stand, lug = read_posed(poses)
    shifted = lug.T @ pose.at((-2.4e-4, 0, 1e-6))
    assert measure_intrusion(stand.solid, stand.T, lug.solid, shifted) == 0.0
    assert {"nz", "pz"} <= {*lug.solid.faces}, "the seat stays"
    scenario = apo_bench.import_assembly(files, tmp_path / "own.toml", unit="mm")
    assert len(scenario.assembly.operations[0].contacts) == 1
    assert "no whole face explains it" in (tmp_path / "own.toml").read_text(encoding="utf-8")
    with pytest.raises(RuntimeError, match=r"'stand' and 'lug' are 0\.\d+ mm inside each other"):
        apo_bench.import_assembly(files, tmp_path / "other.toml", unit="mm", fits="refuse")


SLOT = block(60, 40, 10) + block(20, 40, 40, (-20, 0, 10)) + block(20, 40, 40, (20, 0, 10))
TONGUE = block(20, 40, 20, (0, 0, 10)) + block(16, 40, 60, (0, 0, 30))
BEADS = [Manifold.cylinder(40, 3, 3, 24).rotate((90, 0, 0)).translate((x, 20, 40)) for x in (-7, 7)]


def test_a_bead_that_leaves_a_tongue_no_play_is_cut_back(tmp_path: Path) -> None:
    """The beads touch the walls of the slot along a line, which makes no contact that could recede."""
    solids = {"slot": SLOT, "tongue": TONGUE + BEADS[0] + BEADS[1]}
    files = [write_stl(solid, tmp_path / f"{name}.stl") for name, solid in solids.items()]
    scenario = apo_bench.import_assembly(files, tmp_path / "own.toml", unit="mm")
    assert "touch as drawn, where no whole face explains it" in (tmp_path / "own.toml").read_text(encoding="utf-8")
    slot, tongue = (scenario.assembly.solids[name] for name in ("slot", "tongue"))
    assert any(face.fit for face in tongue.faces.values())
    thin = replace(tongue, pieces=shrink_pieces(tongue, 2.5e-4))
    goal = pose.inverse(scenario.start["slot"]) @ scenario.nominal_poses[0]
    for way in (-1.0, 1.0):
        shifted = pose.at((way * 2.3e-4, 0, 1e-6)) @ goal
        assert measure_intrusion(slot, np.eye(4), thin, shifted) < 1e-5, "0.25 mm of play, cut to 0.02 mm"


@pytest.fixture(scope="module")
def fitted(tmp_path_factory: pytest.TempPathFactory) -> tuple[PosedPart, PosedPart]:
    """A plate with a hole that is 0.2 mm wider than its pin, on each side."""
    plate = extrude(make_rectangle(60, 60), 0, 15, bores=[bore((0, 0), 5.2, 0, 15, "bore")], bottom="under", top="over")
    pin = make_shaft(5, 0, 40, "side", bottom="tip", top="head")
    return made(tmp_path_factory.mktemp("fitted"), plate=(plate, (0, 0, 0)), pin=(pin, (0, 0, 0)))  # type: ignore[return-value]


@pytest.mark.parametrize("shift_mm", [0.5, 2.0])
@pytest.mark.parametrize("deg", range(0, 360, 72))
def test_a_pin_that_was_moved_into_the_wall_of_its_hole_is_named(
    fitted: tuple[PosedPart, PosedPart], shift_mm: float, deg: float
) -> None:
    plate, pin = fitted
    off = 1e-3 * shift_mm * np.array([np.cos(np.radians(deg)), np.sin(np.radians(deg)), 0.0])
    sentence = describe_overlap(replace(pin, T=pose.at(off) @ pin.T), plate)
    assert sentence.startswith("'pin' is")
    assert "on one side only" in sentence


def test_what_has_play_or_is_too_thick_all_around_is_not_named(
    fitted: tuple[PosedPart, PosedPart], tmp_path: Path
) -> None:
    plate, pin = fitted
    assert describe_overlap(pin, plate) == ""
    (thick,) = made(tmp_path, pin=(make_shaft(5.4, 0, 40, "side", bottom="tip", top="head"), (0, 0, 0)))
    assert describe_overlap(thick, plate) == ""


@pytest.mark.parametrize("shift_mm", [0.5, 2.0])
def test_a_part_that_was_moved_off_its_seat_or_off_the_axis_of_its_hole_is_named(
    shift_mm: float, tmp_path: Path
) -> None:
    """A pin with play stands on the bottom of its hole; a stud is thicker than its hole, as threads are drawn."""
    base = extrude(make_rectangle(60, 60), 0, 15, bores=[bore((0, 0), 5.2, 5, 15, "bore")], bottom="under", top="over")
    hole = base.moved((100, 0, 0))
    pin, stud = (make_shaft(r, 5, 40, "side", bottom="tip", top="head") for r in (5.0, 5.4))
    pair = made(tmp_path, base=(base, (0, 0, 0)), pin=(pin, (0, 0, 0)))
    thread = made(tmp_path, hole=(hole, (0, 0, 0)), stud=(stud, (100, 0, 0)))
    assert list_misplaced([*pair, *thread]) == []
    (lifted,) = list_misplaced([pair[0], replace(pair[1], T=pose.at((0, 0, 1e-3 * shift_mm)) @ pair[1].T)])
    assert "mm away from" in lifted
    (aside,) = list_misplaced([thread[0], replace(thread[1], T=pose.at((1e-3 * shift_mm, 0, 0)) @ thread[1].T)])
    assert f"{shift_mm:.2g} mm apart" in aside
