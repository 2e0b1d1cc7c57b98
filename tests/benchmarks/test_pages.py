"""Scripts that write a page of results read the trials of a sweep."""

from __future__ import annotations

from pathlib import Path

from benchmarks import arms, robot_errors, robust, round
from benchmarks.provenance import count_revisions, mujoco_of
from benchmarks.rates_by_condition import group, rate_of, read_judged
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


def test_rates_under_robot_errors_are_those_of_the_trials() -> None:
    rows = [row for row in ROWS if row["scenario"] == "stick_in_tower" and row["method"] == "contact"]
    rate = rate_of(rows)
    assert f"| {rate.successes} of {rate.trials} (" in robot_errors.page(rows, 1)


def test_rates_under_outliers_are_pooled_and_paired() -> None:
    rows = [{**row, "noise": "outliers"} for row in ROWS if row["method"] == "contact"]
    rows += [{**row, "method": "contact-robust"} for row in rows]
    rates = {place: rate_of(own) for place, own in group(rows, robust.place_of).items()}
    text = "\n".join(robust.page(rows, rates, ["3.17.0"]))
    rate = rate_of(rows[: len(rows) // 2])
    assert f"| `contact-robust` | 0 | {rate.successes} of {rate.trials} (" in text
    assert f"| {rate.trials} | {rate.successes} | {rate.successes} | +0.0 points" in text


def test_half_the_time_step_is_compared_seed_by_seed() -> None:
    other = [{**row, "success": not row["success"]} for row in ROWS]
    lines = list(round.half_step(group(ROWS, round.place_of), other))
    assert lines[-1] == ["all", len(ROWS), f"{len(ROWS)} (100.0 %)"]
    assert "## Success" in "\n".join(round.page(group(ROWS, round.place_of), other))


def test_a_page_states_what_its_sweeps_ran_with() -> None:
    assert count_revisions([SWEEP, SWEEP]) == 1
    assert len(mujoco_of([SWEEP])) == 1
