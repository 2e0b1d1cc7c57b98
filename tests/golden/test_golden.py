"""The subset `small` of the golden data, computed again: corrections, detected contacts, ends of trials and episodes.

`python -m benchmarks.golden --collect tests/golden/small.jsonl.xz --subset small` made the data. Its tolerances are for
other processors: OpenBLAS and NumPy choose their code by what the processor can do.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.golden import CLOSE, VERDICT, distance, moved, read
from benchmarks.golden_items import METHODS, OPTIONS, SCENARIOS, Item, design
from benchmarks.golden_values import compute

GOLDEN = read(Path(__file__).with_name("small.jsonl.xz"))
SMALL = [item for item in design() if item.small]
WITHOUT_PHYSICS = ("observation", "detection", "correction")
OBSERVED = [item for item in SMALL if item.kind == "observation"]
CARRIED_OUT = [item for item in SMALL if item.kind in ("trial", "episode") and GOLDEN[item.name]["stable"]]


def values(item: Item) -> dict[str, Any]:
    found: dict[str, Any] = GOLDEN[item.name]["values"]
    return found


@pytest.mark.parametrize("item", OBSERVED, ids=lambda item: f"{item.scenario} seed {item.seed}")
def test_observations_contacts_and_corrections_are_as_recorded(item: Item) -> None:
    """From the recorded demonstration on, so that nothing is simulated."""
    same = (item.scenario, item.seed)
    without = [other for other in SMALL if (other.scenario, other.seed) == same and other.kind in WITHOUT_PHYSICS]
    now = {other.name: compute(other, recorded=values(item)) for other in without if GOLDEN[other.name]["stable"]}
    assert {name: list(moved(GOLDEN[name]["values"], each, CLOSE)) for name, each in now.items()} == {
        name: [] for name in now
    }


@pytest.mark.parametrize("item", CARRIED_OUT, ids=lambda item: item.name)
def test_trials_and_episodes_end_as_recorded(item: Item) -> None:
    """Those that a perturbation of 1e-9 m does not change, so that rounding should not either."""
    now = compute(item)
    assert {key: now.get(key) for key in VERDICT} == {key: values(item).get(key) for key in VERDICT}


def test_the_data_holds_the_subset_and_nothing_else() -> None:
    assert list(GOLDEN) == [item.name for item in SMALL]
    assert all(line["values"] for line in GOLDEN.values())


def test_the_design_touches_every_scenario_method_fidelity_and_option() -> None:
    trials = [item for item in design() if item.kind == "trial"]
    touched = {(item.scenario, item.case) for item in trials}
    expected = {(s, f"method={m} fidelity={f}") for s in SCENARIOS for m in METHODS for f in ("full", "near-contact")}
    assert expected <= touched
    assert min(Counter(item.case for item in trials if item.case in OPTIONS).values()) >= 3
    assert len({item.case for item in trials}) == 2 * len(METHODS) + len(OPTIONS)


def test_most_of_the_subset_is_stable_and_both_ends_occur_in_it() -> None:
    stable = [GOLDEN[item.name]["stable"] for item in SMALL if item.kind != "observation"]
    assert sum(stable) > 0.9 * len(stable)
    assert {values(item).get("success") for item in CARRIED_OUT} == {True, False}


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [(1.0, 1.0 + 1e-8, 1e-8), (1e4, 1e4 + 1e-4, 1e-8), ("gap", "overlap", np.inf), (1.0, None, np.inf)],
)
def test_distance_is_relative_above_one_and_infinite_between_words(a: Any, b: Any, expected: float) -> None:
    assert distance(a, b) == pytest.approx(expected, rel=1e-3)


def test_moved_names_the_key_and_the_entry_that_is_farthest_off() -> None:
    old = {"poses": [1.0, 2.0, 3.0], "status": "converged", "gone": 1.0}
    new = {"poses": [1.0, 2.0 + 1e-3, 3.0 + 1e-2], "status": "converged", "more": 2.0}
    found = {key: (a, b) for key, a, b, _ in moved(old, new, 1e-6)}
    assert found == {"poses": (3.0, 3.01), "gone": (1.0, None), "more": (None, 2.0)}
    assert not list(moved(old, old | {"poses": [1.0, 2.0, 3.0 + 1e-7]}, 1e-6))
