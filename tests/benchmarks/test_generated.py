"""Generated assemblies, and how files in a folder are paired; what becomes of them is measured, not tested."""

from __future__ import annotations

from pathlib import Path

from benchmarks.foreign import assemblies
from benchmarks.generated import generated, write


def test_assemblies_have_three_to_eight_parts_and_are_the_same_again(tmp_path: Path) -> None:
    for seed in range(10):
        assert 3 <= len(generated(seed).places) <= 8
    first, again = (write(generated(4), tmp_path / name) for name in ("first", "again"))
    assert first.read_text(encoding="utf-8") == again.read_text(encoding="utf-8")


def test_plugs_and_sockets_are_pairs_and_other_files_assemblies(tmp_path: Path) -> None:
    for name in ("a_plug.obj", "a_socket.stl", "b_plug.stl", "c.STEP", "d.txt"):
        (tmp_path / name).touch()
    assert [(each.name, [file.name for file in each.files]) for each in assemblies(tmp_path)] == [
        ("a", ["a_socket.stl", "a_plug.obj"]),
        ("b_plug", ["b_plug.stl"]),
        ("c", ["c.STEP"]),
    ]
