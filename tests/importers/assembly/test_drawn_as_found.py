"""Assemblies as people draw them: dowels flush with a cover, small tilts, thick shafts, names of nuts."""

from __future__ import annotations

from pathlib import Path

import pytest

from apo_bench import InputError, load_scenario
from apo_bench.importers.assembly.choices import AssemblyChoices
from apo_bench.importers.assembly.new_scenario import new_scenario
from apo_bench.importers.assembly.posed_parts import place_on_table
from apo_bench.importers.assembly.scenario_check import check_file
from apo_bench.importers.assembly.scenario_writer import write_scenario
from apo_bench.importers.assembly.up_axis import new_upright_scenario
from apo_bench.scenario.parts.making import Body, bore, extrude, make_rectangle, make_shaft
from tests.importers.assembly.test_blocked import made, turned

SLAB = extrude(make_rectangle(80, 60), 0, 15, bottom="bottom", top="top")
CUBE = extrude(make_rectangle(30, 20), 0, 30, bottom="foot", top="head")


def bored(low: float, high: float, radius: float, *xs: float) -> Body:
    bores = [bore((x, 0), radius, low, high, f"bore{i}") for i, x in enumerate(xs)]
    return extrude(make_rectangle(100, 60), low, high, bores=bores, bottom="bottom", top="top")


def test_dowels_that_are_flush_with_a_cover_go_in_before_it(tmp_path: Path) -> None:
    dowel = make_shaft(3, 0, 25, "side", bottom="tip", top="head")
    parts = made(
        tmp_path,
        floor=(extrude(make_rectangle(100, 60), 0, 15, bottom="under", top="over"), (0, 0, 0)),
        housing=(bored(0, 15, 3.2, -35, 35), (0, 0, 15)),
        cover=(bored(0, 10, 3.2, -35, 35), (0, 0, 30)),
        left=(dowel, (-35, 0, 15)),
        right=(dowel, (35, 0, 15)),
    )
    found = new_scenario(place_on_table(parts), ("floor", "housing"))
    assert found.order[-1].moves == ("cover",)
    assert found.unfit == ()


@pytest.mark.parametrize("tilt", [(7e-5, 0, 0), (7e-5, 1.4e-4, 30), (2e-4, 2e-4, 0)])
def test_a_part_that_is_hardly_tilted_gets_a_grasp_that_can_be_read(
    tilt: tuple[float, float, float], tmp_path: Path
) -> None:
    parts = turned(made(tmp_path, slab=(SLAB, (0, 0, 0)), cube=(CUBE, (0, 0, 15))), *tilt)
    write_scenario(new_upright_scenario(parts), tmp_path / "own.toml", "own", "a test")
    assert len(load_scenario(tmp_path / "own.toml").assembly) == 1


def test_the_name_of_a_nut_is_no_fault(tmp_path: Path) -> None:
    parts = made(tmp_path, slab=(SLAB, (0, 0, 0)), nut=(CUBE, (0, 0, 15)))
    write_scenario(new_upright_scenario(parts), tmp_path / "own.toml", "own", "a test")
    findings = {each.what: each for each in check_file(tmp_path / "own.toml", seeds=0)}
    assert all(each.ok for each in findings.values())
    assert findings["parts"].sentence.startswith("nut: by the name a screw, nut or spring")


@pytest.mark.parametrize("radius", [4.0, 3.7, 3.3])
def test_a_shaft_thicker_than_its_hole_widens_the_hole_up_to_the_limit(radius: float, tmp_path: Path) -> None:
    plate = extrude(
        make_rectangle(80, 60), 0, 15, bores=[bore((0, 0), radius, 5, 15, "bore")], bottom="under", top="over"
    )
    pin = make_shaft(4, 0, 45, "side", bottom="tip", top="head")
    parts = made(tmp_path, plate=(plate, (0, 0, 0)), pin=(pin, (0, 0, 5)))
    new = new_upright_scenario(parts)
    fits = {each.name: dict(each.fit) for each in new.parts}
    if radius == 4.0:
        assert fits == {"plate": {}, "pin": {"side": 0.0}}
    else:
        assert fits == {"plate": {"bore": pytest.approx(4.0 - radius)}, "pin": {}}
        assert f"'plate' was drawn {4.0 - radius:.2g} mm inside 'pin': bore of 'plate' recede" in new.notes[0]
        with pytest.raises(RuntimeError, match="a press fit or a thread"):
            new_upright_scenario(parts, AssemblyChoices(fits="refuse"))
        with pytest.raises(InputError, match="1 pairs of parts have no play: 'plate' was drawn"):
            new_upright_scenario(parts, AssemblyChoices(fits="ask"))
    write_scenario(new, tmp_path / "own.toml", "own", "a test")
    assert len(load_scenario(tmp_path / "own.toml").assembly.operations[0].contacts) == 2


def test_what_was_apart_does_not_recede_and_what_is_deeper_than_the_limit_is_refused(tmp_path: Path) -> None:
    parts = made(tmp_path, slab=(SLAB, (0, 0, 0)), cube=(CUBE, (0, 0, 15.3)), other=(CUBE, (32, 0, 15)))
    assert all(not each.fit for each in new_upright_scenario(parts[::2]).parts)
    deep = made(tmp_path, slab=(SLAB, (0, 0, 0)), cube=(CUBE, (0, 0, 13.5)))
    with pytest.raises(RuntimeError, match=r"'slab' and 'cube' are 1\.5 mm inside each other"):
        new_upright_scenario(deep)
