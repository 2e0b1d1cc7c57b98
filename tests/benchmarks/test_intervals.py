"""The study of coverage: small again, with the streams of the whole, and what was kept of the whole."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from benchmarks.intervals import PAGE, STUDIES, TABLE, Setting, coverage, settings, size, tables


def kept() -> list[tuple[Setting, int, float]]:
    with TABLE.open(encoding="utf-8") as file:
        return [
            (
                Setting(r["interval"], int(r["seeds"]), *(float(r[x]) for x in ("rate", "other", "alike"))),
                int(r["experiments"]),
                float(r["coverage"]),
            )
            for r in csv.DictReader(file)
        ]


def test_every_interval_holds_the_truth_in_94_to_97_of_100() -> None:
    assert {n for _, n, _ in kept()} == {10_000, 2_000}
    for name in STUDIES:
        found = [c for s, _, c in kept() if s.interval == name]
        assert 0.94 <= np.mean(found) <= (1.0 if name == "sure bounds" else 0.97), name


def test_every_setting_was_studied_and_the_page_shows_it() -> None:
    asked = list(settings())
    assert [s for s, _, _ in kept()] == asked
    assert "\n".join(tables(asked, [c for _, _, c in kept()], 10_000)) in PAGE.read_text(encoding="utf-8")
    assert size(asked[0], 10_000) == 10_000


@pytest.mark.parametrize("interval", STUDIES)
def test_a_small_study_says_much_the_same(interval: str) -> None:
    number, (setting, _, whole) = next((i, k) for i, k in enumerate(kept()) if k[0].interval == interval and i > 500)
    small = coverage(number, setting, 400 if size(setting, 10) == 10 else 1000)
    assert small == coverage(number, setting, 400 if size(setting, 10) == 10 else 1000)
    assert small == pytest.approx(whole, abs=0.05)
