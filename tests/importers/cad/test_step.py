"""Parts from STEP files of known solids: faces as the file has them, copies, names, colours, splines, and refusals."""

from __future__ import annotations

import os
import re
import tomllib
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from apo_bench import InputError
from apo_bench.cli.app import main
from apo_bench.importers.cad.part_import import ImportedPart, import_solid, read_raw_solids
from apo_bench.importers.cad.step.brep import read_solids
from apo_bench.importers.cad.step.from_brep import raw_of
from tests.importers.cad.held import hold
from tests.importers.cad.made import MADE

pytestmark = [
    pytest.mark.extras,
    pytest.mark.skipif(find_spec("build123d") is None, reason="the extra cad is not installed"),
]
EXACT_MM = 1e-6


def write_step(shape: Any, path: Path) -> Path:
    """A STEP file in mm."""
    from build123d import export_step

    assert export_step(shape, path)
    return path


def draw(name: str) -> Any:
    """A solid of `MADE` with exact faces."""
    from build123d import Align, Box, Cone, Cylinder, Pos

    up = (Align.CENTER, Align.CENTER, Align.MIN)
    if name == "bush":
        return Cylinder(9, 20, align=up) - Cylinder(5, 20, align=up)
    return Box(40, 40, 20, align=up) - Cylinder(4, 16, align=up) - Pos(0, 0, 16) * Cone(4, 8, 4, align=up)


def imported(shape: Any, folder: Path) -> ImportedPart:
    """In this process, which has read build123d already."""
    path = write_step(shape, folder / "a.step")
    (solid,) = read_solids(path)
    return import_solid(raw_of(path, solid), "a", folder, "a.step", density=8000.0)


@pytest.mark.parametrize("name", ["bush", "countersink"])
def test_faces_and_parameters_are_those_of_the_file(name: str, tmp_path: Path) -> None:
    hold(imported(draw(name), tmp_path), MADE[name](), EXACT_MM)


def test_splines_that_are_flat_or_round_are_found(tmp_path: Path) -> None:
    from build123d import Solid
    from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert

    solid = Solid(BRepBuilderAPI_NurbsConvert(draw("countersink").solid().wrapped).Shape())
    assert {str(face.geom_type) for face in solid.faces()} == {"GeomType.BSPLINE"}
    done = imported(solid, tmp_path)
    kinds = [region.kind for region in done.raw.regions]
    assert (kinds.count("plane"), kinds.count("cylinder"), kinds.count("cone")) == (6, 1, 1)
    assert done.raw.named()["hole1"].radii == pytest.approx((4, 4), abs=EXACT_MM)
    assert dict(done.refused) == {}


def test_an_assembly_keeps_copies_names_and_colours(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from build123d import Box, Color, Compound, Cylinder, Location, Pos

    plate = Box(60, 40, 20) - Pos(5, -3, 0) * Cylinder(5.1, 20)
    plate.label = "plate"
    plate.color = Color(1, 0, 0)
    pin = Cylinder(5, 40)
    pins = [pin.located(Location((5, -3, 10))), pin.located(Location((100, 0, 0), (0, 90, 0)))]
    for each in pins:
        each.label = "pin"
        each.color = Color(0, 0.5, 1)
    inner = Compound(label="inner", children=[pins[0]])
    inner.location = Location((0, 0, 7), (0, 0, 90))
    path = write_step(Compound(label="all", children=[plate, inner, pins[1]]), tmp_path / "a.step")
    out = tmp_path / "out"
    assert main(["part", "import", str(path), "--out", str(out), "--json"]) == 0
    assert '"unit": "mm"' in capsys.readouterr().out
    assert {each.name for each in out.glob("*.xml")} == {"plate.xml", "pin.xml"}
    first, second, third = tomllib.loads((out / "poses.toml").read_text())["pose"]
    assert (first["part"], first["color"]) == ("plate", [1, 0, 0])
    assert (second["part"], second["name"], third["part"], third["name"]) == ("pin", "pin", "pin", "pin_2")
    assert second["at_mm"] == pytest.approx([3, 5, 17], abs=EXACT_MM)
    assert second["quaternion_wxyz"] == pytest.approx([0.5**0.5, 0, 0, 0.5**0.5], abs=1e-9)
    assert third["color"] == [0, 0.5, 1]
    text = re.sub(r"(NEXT_ASSEMBLY_USAGE_OCCURRENCE\('(\d+)',)'[^']*'", r"\1'copy \2'", path.read_text())
    path.write_text(text)
    names = {place.name for solid in read_solids(path) for place in solid.places}
    assert len(names) == 3
    assert all(name.startswith("copy ") for name in names)


@pytest.mark.parametrize("kind", ["UTF-8", "UTF-8 written byte by byte", "X2"])
def test_names_that_are_not_latin_are_titles(kind: str, tmp_path: Path) -> None:
    from build123d import Box, Compound, Pos

    plate, pin = Box(40, 30, 10), Pos(0, 0, 12) * Box(10, 9, 24)
    plate.label, pin.label = "plate", "pin"
    path = write_step(Compound(label="jig", children=[plate, pin]), tmp_path / "a.step")
    raw = path.read_bytes()
    for latin, own in (("plate", "底板"), ("pin", "销钉")):
        written = own.encode("utf-8")
        if kind == "X2":
            written = b"\\X2\\" + own.encode("utf-16-be").hex().upper().encode() + b"\\X0\\"
        elif kind != "UTF-8":
            written = written.decode("latin-1").encode("utf-8")
        raw = raw.replace(f"'{latin}'".encode(), b"'" + written + b"'")
    path.write_bytes(raw)
    assert {solid.name for solid in read_solids(path)} == {"底板", "销钉"}


def test_units_are_those_of_the_file(tmp_path: Path) -> None:
    from build123d import Box

    path = write_step(Box(30, 20, 10), tmp_path / "a.step")
    text = path.read_text().replace("SI_UNIT(.MILLI.,.METRE.)", "SI_UNIT(.CENTI.,.METRE.)")
    path.write_text(text)
    file, (raw,) = read_raw_solids(path, None)
    assert file.unit == "cm"
    assert raw.mesh.extent == pytest.approx(300.0)
    path.write_text(text.replace("SI_UNIT(.CENTI.,.METRE.)", "SI_UNIT($,.METRE.)"))
    with pytest.raises(InputError, match=r"is 3e\+04 mm .of a solid in it; unit m, stated in the file."):
        read_raw_solids(path, None)


def test_files_that_are_no_step_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.stp"
    path.touch()
    with pytest.raises(InputError, match="the file is empty"):
        read_raw_solids(path, None)
    path.write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match="no STEP file"):
        read_raw_solids(path, None)
    path.write_text("ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n#1=GARBAGE(#2);\nENDSEC;\nEND-ISO-10303-21;\n")
    with pytest.raises(InputError, match=r"holds no solid|cannot be read"):
        read_raw_solids(path, None)
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(InputError, match="a pipe was given"):
        read_raw_solids(path, None)
