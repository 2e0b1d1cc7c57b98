"""The table of results in README has the counts that are committed."""

from __future__ import annotations

from apo_bench.benchmark.analysis import Rate
from benchmarks.readme_table import HEADLINE, MEASURED, README, conditions, in_readme, pool, rows


def test_the_readme_has_the_table_of_the_committed_counts() -> None:
    text = README.read_text(encoding="utf-8")
    assert in_readme(text) == text, "run: python -m benchmarks.readme_table"


def test_rates_are_pooled_over_scenarios_at_one_level_without_human_error() -> None:
    shown = {
        "method": "contact",
        "noise": "isotropic",
        "robot_error": "none",
        "noise_mm": "1",
        "human_error_scale": "0",
    }
    lines = [
        {**shown, "successes": "3", "trials": "5"},
        {**shown, "successes": "4", "trials": "5"},
        *({**shown, "successes": "5", "trials": "5", **other} for other in ({"noise_mm": "2"}, {"noise": MEASURED})),
    ]
    assert pool(lines, "contact") == Rate(7, 10)
    assert pool(lines, "contact", noise=MEASURED) == Rate(5, 5)


def test_methods_of_one_condition_ran_the_same_number_of_trials() -> None:
    trials: dict[str, set[str]] = {}
    for condition, _, success, _ in rows():
        trials.setdefault(condition, set()).add(success.split(" of ")[1].split()[0])
    assert sorted(map(sorted, trials.values())) == [["40"], ["80"], ["80"]]
    assert {line["fidelity"] for line in conditions(HEADLINE)} == {"near-contact"}
