"""Scripts that write a page of results read the trials of a sweep."""

from __future__ import annotations

from pathlib import Path

from benchmarks import arms
from benchmarks.rates_by_condition import read_judged
from benchmarks.wrong_contacts import PAGE, read, section

SWEEP = Path(__file__).parents[1] / "kept" / "sweep"
ROWS = read_judged([SWEEP])


def test_the_committed_page_has_the_committed_counts_of_wrong_contacts() -> None:
    assert section(read()) in PAGE.read_text(encoding="utf-8"), "run: python -m benchmarks.wrong_contacts"


def test_every_trial_stands_in_the_table_of_arms() -> None:
    won = sum(bool(row["success"]) for row in ROWS)
    totals = [line for line in arms.page(ROWS).splitlines() if line.startswith("| **all**")]
    assert sum(int(line.split("|")[4].split()[0]) for line in totals) == won
    assert sum(int(line.split("|")[4].split()[2]) for line in totals) == len(ROWS)
