"""What the page of outliers says of cameras that fail is what was counted, and what falls short is named."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import wrong_relations
from benchmarks.failures import KINDS, STATED, Draw, drawn
from benchmarks.failures_page import PAGE, Cell, Count, fallen_short, read, row, section
from benchmarks.failures_page import STATED as TITLES


def counts(told: int, robust: int, looks: int, kind: str = "flips") -> dict[Cell, Count]:
    every = {"told": told, "contact-robust": robust, "looks 2": looks}
    return {Cell(1.0, kind, "gearbox", name): Count(100, right) for name, right in every.items()}


def test_the_page_holds_what_is_kept() -> None:
    assert "\n".join(section(read())) in PAGE.read_text(encoding="utf-8"), "run: python -m benchmarks.failures FILE"


def test_the_page_holds_what_is_kept_of_wrong_relations() -> None:
    lines = wrong_relations.section(wrong_relations.read())
    assert "\n".join(lines) in PAGE.read_text(encoding="utf-8"), "run: python -m benchmarks.wrong_relations"


def test_a_row_has_counts_and_shares_of_the_ceiling() -> None:
    assert row(counts(80, 64, 76), 1.0, "flips") == "| flips by 90 or 180 degrees | 100 | 80 | 64 (80 %) | 76 (95 %) |"


def test_what_has_less_than_was_asked_is_named() -> None:
    assert fallen_short(counts(80, 64, 76))[0].endswith("have less: none.")
    (said,) = fallen_short(counts(80, 63, 75))
    assert "flips by 90 or 180 degrees, stated rightly, no look: 79 %" in said
    assert "flips by 90 or 180 degrees, stated rightly, two looks: 94 %" in said
    assert fallen_short(counts(80, 64, 68, "flips-repeated"))[0].endswith("have less: none."), "looks may repeat"


@pytest.mark.parametrize("stated", list(STATED))
def test_a_draw_is_the_same_again_and_states_its_rate(stated: float) -> None:
    one, two = (drawn(Draw(3, "stale", stated)) for _ in range(2))
    np.testing.assert_array_equal(one[2].poses, two[2].poses)
    assert one[2].outliers is not None
    assert one[2].outliers.gross == pytest.approx(one[1].failures[0].rate * stated)
    assert list(TITLES) == list(STATED)
    assert set(KINDS) >= {"flips", "stale", "swaps", "unnamed"}
