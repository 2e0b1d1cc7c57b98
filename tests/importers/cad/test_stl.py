"""STL files as programs leave them: wrong counts, trailing bytes, packed ones; and a size that is small for mm."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from apo_bench import InputError
from apo_bench.importers.cad.part_import import read_raw_solids
from tests.importers.cad.made import block, write_stl


def brick(folder: Path) -> bytes:
    """A binary file of 12 triangles."""
    return write_stl(block(30, 20, 10), folder / "a.stl").read_bytes()


def with_count(raw: bytes, count: int) -> bytes:
    return raw[:80] + count.to_bytes(4, "little") + raw[84:]


READ: dict[str, Callable[[bytes], bytes]] = {
    "bytes behind it": lambda raw: raw + b"trailer",
    "count 0": lambda raw: with_count(raw, 0),
    "count unknown": lambda raw: with_count(raw, 2**32 - 1),
    "count too small": lambda raw: with_count(raw, 5),
}


@pytest.mark.parametrize("case", READ)
def test_triangles_are_read_in_spite_of_a_wrong_count(case: str, tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(READ[case](brick(tmp_path)))
    _, (raw,) = read_raw_solids(tmp_path / "a.stl", None)
    assert raw.mesh.volume == pytest.approx(6000.0)


REFUSED: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "cut between triangles": (lambda raw: raw[:-50], "the shell is open"),
    "a header alone": (lambda raw: raw[:84], "holds no triangles"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_read_is_refused_with_its_cause(case: str, tmp_path: Path) -> None:
    change, sentence = REFUSED[case]
    (tmp_path / "a.stl").write_bytes(change(brick(tmp_path)))
    with pytest.raises(InputError, match=sentence):
        read_raw_solids(tmp_path / "a.stl", None)
