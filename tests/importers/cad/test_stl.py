"""STL files as programs leave them: wrong counts, trailing bytes, packed ones; and a size that is small for mm."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from apo_bench import InputError
from apo_bench.cli.app import main
from apo_bench.importers.assembly.from_cad import import_parts
from apo_bench.importers.cad.importing import raw_solids
from tests.importers.cad.made import block, write_stl


def brick(folder: Path) -> bytes:
    """A binary file of 12 triangles."""
    return write_stl(block(30, 20, 10), folder / "a.stl").read_bytes()


def with_count(raw: bytes, count: int) -> bytes:
    return raw[:80] + count.to_bytes(4, "little") + raw[84:]


READ: dict[str, Callable[[bytes], bytes]] = {
    "as it is": lambda raw: raw,
    "bytes behind it": lambda raw: raw + b"trailer",
    "many bytes behind it": lambda raw: raw + bytes(333),
    "count 0": lambda raw: with_count(raw, 0),
    "count unknown": lambda raw: with_count(raw, 2**32 - 1),
    "count too small": lambda raw: with_count(raw, 5),
    "a header as of a text file": lambda raw: b"solid a".ljust(80) + raw[80:],
}


@pytest.mark.parametrize("case", READ)
def test_triangles_are_read_in_spite_of_a_wrong_count(case: str, tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(READ[case](brick(tmp_path)))
    _, (raw,) = raw_solids(tmp_path / "a.stl", None)
    assert raw.mesh.volume == pytest.approx(6000.0)


REFUSED: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "cut short": (lambda raw: raw[:-20], "states 12 triangles and holds 11 and a part of one"),
    "cut between triangles": (lambda raw: raw[:-50], "the shell is open"),
    "count 0 and bytes behind it": (lambda raw: with_count(raw, 0) + b"abc", "states 0 triangles and holds 12"),
    "a header alone": (lambda raw: raw[:84], "holds no triangles"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_read_is_refused_with_its_cause(case: str, tmp_path: Path) -> None:
    change, sentence = REFUSED[case]
    (tmp_path / "a.stl").write_bytes(change(brick(tmp_path)))
    with pytest.raises(InputError, match=sentence):
        raw_solids(tmp_path / "a.stl", None)


def test_a_plate_of_12_cm_without_a_unit_gets_cm_offered(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plate = write_stl(block(12, 8, 1.6), tmp_path / "plate.stl")
    out = str(tmp_path / "out")
    assert main(["part", "import", str(plate), "--out", out]) == 0
    assert "WARNING: the longest side is 12 mm" in (said := capsys.readouterr().out)
    assert "cm (120 mm)" in said
    assert main(["part", "import", str(plate), "--out", out, "--json"]) == 0
    assert "WARNING" in json.loads(capsys.readouterr().out)["warnings"][0]
    for unit in ("cm", "mm"):
        assert main(["part", "import", str(plate), "--out", out, "--unit", unit]) == 0
        assert "WARNING" not in capsys.readouterr().out
    base = write_stl(block(120, 80, 10, (0, 0, -10)), tmp_path / "base.stl")
    _, lines = import_parts([base, plate], tmp_path / "parts")
    assert [line for line in lines if "WARNING" in line and "plate.stl" in line and "--unit cm" in line]
    assert not [line for line in lines if "WARNING" in line and "base.stl" in line]
