"""The first example of the guide: its blocks run one after the other, and print what the page shows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.docs.blocks import python_blocks, run_block, same_output

PAGE = Path(__file__).parents[2] / "docs" / "guide" / "first-trial.md"


def test_the_blocks_of_the_first_trial_print_what_the_page_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "__main__"}
    blocks = python_blocks(PAGE)
    assert len(blocks) > 5
    for block in blocks:
        printed = run_block(block, names)
        assert same_output(printed, block.output or ""), f"{PAGE.name}:{block.line} prints\n{printed}"


def test_the_trial_by_hand_has_ten_lines() -> None:
    lines = [line for line in python_blocks(PAGE)[0].code.splitlines() if line and not line.startswith("import ")]
    assert len(lines) <= 10


@pytest.mark.parametrize(
    ("printed", "shown", "same"),
    [
        ("gap 0.304 mm", "gap 0.303 mm", True),
        ("gap 5.77 mm", "gap 5.78 mm", True),
        ("gap 0.31 mm", "gap 0.36 mm", False),
        ("gap 0.3 mm", "gap 0.3 cm", False),
        ("True", "False", False),
        ("1 2", "1 2 3", False),
    ],
)
def test_printed_numbers_are_compared_to_rounding_and_words_exactly(printed: str, shown: str, same: bool) -> None:
    assert same_output(printed, shown) is same
