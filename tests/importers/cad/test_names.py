"""Names of parts from names in CAD files: identifiers in Latin letters, titles as they were given."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from apo_bench.cli.app import main
from apo_bench.importers.assembly.posed import read_posed
from apo_bench.importers.cad.solids import make_part_name
from apo_bench.scenario.parts.stated import read_stated_part
from tests.importers.cad.made import L_SHAPE, block, prism, write_stl


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("lid 1", "lid_1"),
        ("Größe", "Grosse"),
        ("smørbrød", "part_1"),
        ("底板", "part_1"),
        ("ＡＢ１", "AB1"),
        ("3 pins", "part_3_pins"),
        ("", "part_1"),
        ("a" * 60, "a" * 48),
    ],
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


def test_places_of_parts_have_titles_too(tmp_path: Path) -> None:
    both = write_stl(block(30, 20, 10) + block(9, 8, 7, (50, 0, 0)), tmp_path / "夹具 -- \\x.stl")
    assert main(["part", "import", str(both), "--out", str(tmp_path)]) == 0
    poses = tomllib.loads((tmp_path / "poses.toml").read_text(encoding="utf-8"))["pose"]
    assert [each["title"] for each in poses] == ["夹具 -- \\x_1", "夹具 -- \\x_2"]
    assert [each.title for each in read_posed(tmp_path / "poses.toml")] == ["夹具 -- \\x_1", "夹具 -- \\x_2"]
