"""Names of parts from names in CAD files: identifiers in Latin letters, titles as they were given."""

from __future__ import annotations

from pathlib import Path

import pytest

from apo_bench.cli.app import main
from apo_bench.importers.cad.solids import make_part_name
from apo_bench.scenario.parts.stated_properties import read_stated_part
from tests.importers.cad.made import L_SHAPE, block, prism, write_stl


@pytest.mark.parametrize(
    ("text", "name"),
    [("lid 1", "lid_1"), ("Größe", "Grosse"), ("smørbrød", "part_1"), ("3 pins", "part_3_pins"), ("", "part_1")],
)
def test_names_have_latin_letters_or_a_number(text: str, name: str) -> None:
    assert make_part_name(text, ()) == name


def test_no_two_parts_have_one_name() -> None:
    used: set[str] = set()
    for text in ("底板", "销钉", "part_3", "轴", "pin", "pin"):
        used.add(make_part_name(text, used))
    assert used == {"part_1", "part_2", "part_3", "part_4", "pin", "pin_2"}


def test_the_name_is_kept_as_a_title_and_files_of_other_names_are_not_replaced(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    profile = write_stl(prism(L_SHAPE, 20) + prism([(0, 0), (20, 0), (0, 30)], 30), tmp_path / "角铁.stl")
    brick = write_stl(block(30, 20, 10), tmp_path / "木块.stl")
    for file in (profile, brick, profile):
        assert main(["part", "import", str(file), "--out", str(out)]) == 0
    assert "  title: 角铁\n" in capsys.readouterr().out
    assert sorted(each.name for each in out.glob("*.xml")) == ["part_1.xml", "part_2.xml"]
    assert read_stated_part(out / "part_1.toml").title == "角铁"
    assert "木块" in (out / "part_2.xml").read_text(encoding="utf-8")
