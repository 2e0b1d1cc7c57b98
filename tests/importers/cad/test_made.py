"""Parts from STL files of known solids: faces, parameters, volume, free radii; and the same on every import."""

from __future__ import annotations

from pathlib import Path

import pytest

from apo_bench.importers.cad.part_import import ImportedPart, import_solid, read_raw_solids
from apo_bench.scenario.parts import load_part
from tests.importers.cad.held import hold
from tests.importers.cad.made import MADE, write_stl

PARAMETER_MM = 0.02


def imported(name: str, folder: Path) -> ImportedPart:
    _, (raw,) = read_raw_solids(write_stl(MADE[name]().mesh, folder / f"{name}.stl"), None)
    return import_solid(raw, name, folder, f"{name}.stl", density=8000.0)


@pytest.mark.parametrize("name", MADE)
def test_faces_parameters_volume_and_free_radii_are_those_of_the_solid(name: str, tmp_path: Path) -> None:
    made = MADE[name]()
    done = imported(name, tmp_path)
    hold(done, made, PARAMETER_MM)
    again = load_part(done.path)
    assert {*again.faces, *again.rounds} >= {r.name for r in done.raw.regions if r.name}


def test_names_are_the_same_each_time_and_say_what_and_where(tmp_path: Path) -> None:
    first, second = (imported("bracket", tmp_path) for _ in range(2))
    assert list(first.raw.named()) == list(second.raw.named())
    named = first.raw.named()
    assert set(named) == {"px", "px2", "nx", "py", "ny", "pz", "pz2", "nz", "hole1", "hole2"}
    assert named["hole1"].radii[0] == pytest.approx(4.2, abs=PARAMETER_MM)
    assert named["hole2"].span == pytest.approx((0.0, 10.0), abs=PARAMETER_MM)
    assert named["pz"].point[2] == pytest.approx(50.0)
