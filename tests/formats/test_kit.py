"""The kit for a real robot: what is printed imports again with the same faces, and the form names every trial."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from apo_bench import InputError, load_scenario
from apo_bench.formats.kit import FORM_COLUMNS, TAG_EDGE_MM, make_part_mesh, make_plate_mesh, write_kit
from apo_bench.geometry import Solid
from apo_bench.importers.cad.part_import import read_raw_solids
from apo_bench.io import read_csv

CLEARANCE_MM = 0.3


def planes(solid: Solid, clearance_mm: float) -> list[tuple[float, ...]]:
    """Normal and distance of every flat face as it is printed [mm], in some order."""
    rows = [
        (*face.normal, 1e3 * (face.normal @ face.outline[0]) - clearance_mm * face.fit) for face in solid.faces.values()
    ]
    return sorted(tuple(np.round(row, 3) + 0.0) for row in rows)


@pytest.mark.parametrize("suffix", ["stl", pytest.param("step", marks=pytest.mark.extras)])
def test_what_is_printed_imports_again_with_the_same_faces(tmp_path: Path, suffix: str) -> None:
    if suffix == "step" and find_spec("build123d") is None:
        pytest.skip("needs the extra cad")
    scenario = load_scenario("stick_in_tower")
    written = write_kit(scenario, CLEARANCE_MM, tmp_path, ["contact"], 1, step=suffix == "step")
    assert {path.name: count for path, count in written.items()} == {"castle.stl": 2, "stick.stl": 1, "plate.stl": 1}
    for part in ("castle1", "stick"):
        solid = scenario.assembly.solids[part]
        file = tmp_path / f"{scenario.part_files[part].stem}.{suffix}"
        _, (raw,) = read_raw_solids(file, "mm" if suffix == "stl" else None)
        found = [(*region.direction, region.direction @ region.point) for region in raw.regions]
        assert sorted(tuple(np.round(row, 3) + 0.0) for row in found) == planes(solid, CLEARANCE_MM)


def test_fit_faces_recede_by_the_clearance_and_the_plate_keeps_the_pockets_of_its_table() -> None:
    scenario = load_scenario("pocket_table")
    stick = make_part_mesh(scenario.assembly.solids["stick"], CLEARANCE_MM)
    assert np.allclose(stick.extents, (220.0, 20 - 2 * CLEARANCE_MM, 20 - 2 * CLEARANCE_MM))
    plate = make_plate_mesh(scenario, CLEARANCE_MM)
    tags_and_pockets = 4 * 38**2 * 0.4 + 2 * (50 + 2 * CLEARANCE_MM) ** 2 * 6
    assert plate.volume == pytest.approx(200 * 200 * 10 - tags_and_pockets, rel=1e-6)


def test_a_part_that_makes_no_closed_solid_is_refused() -> None:
    roof = load_scenario("wedge_under_roof").assembly.solids
    with pytest.raises(InputError, match="'lean_to' is not one closed solid at a clearance of"):
        make_part_mesh(roof["roof"], CLEARANCE_MM)


def test_the_form_has_a_line_for_each_method_of_each_trial_and_tags_their_places(tmp_path: Path) -> None:
    write_kit(load_scenario("stick_in_tower"), 0.25, tmp_path, ["uncorrected", "contact"], 3, step=False)
    rows = list(read_csv(tmp_path / "form.csv", FORM_COLUMNS, list(FORM_COLUMNS)))
    assert [(row.text("trial"), row.text("method")) for row in rows] == [
        (str(k), method) for k in (1, 2, 3) for method in ("uncorrected", "contact")
    ]
    tags = (tmp_path / "tags.csv").read_text(encoding="utf-8").splitlines()
    assert tags[1] == f"tag36h11,0,{TAG_EDGE_MM},-80.0,-80.0,-0.4"
