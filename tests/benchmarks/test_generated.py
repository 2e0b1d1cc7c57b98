"""Generated assemblies; what becomes of them is measured, not tested."""

from __future__ import annotations

from pathlib import Path

from benchmarks.generated import generated, write


def test_assemblies_have_three_to_eight_parts_and_are_the_same_again(tmp_path: Path) -> None:
    for seed in range(10):
        assert 3 <= len(generated(seed).places) <= 8
    first, again = (write(generated(4), tmp_path / name) for name in ("first", "again"))
    assert first.read_text(encoding="utf-8") == again.read_text(encoding="utf-8")
