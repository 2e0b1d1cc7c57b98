"""All numbers of a report in one call: the same in any order, and quick enough."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench import InputError
from apo_bench.benchmark.analysis import summarise
from tests.benchmark.analysis.test_rates import row

METHODS = ("uncorrected", "paper", "contact")


def rows(seeds: int = 12, scenarios: int = 1) -> list[dict[str, Any]]:
    """Success that falls with the level, seeds with luck of their own."""
    luck = np.random.default_rng(7).random(seeds)
    return [
        row(m, s, bool(luck[s] < 1 / (1 + (x / h) ** 3)), scenario=f"scenario{i}", noise_mm=x, noise_deg=x)
        for i in range(scenarios)
        for m, h in zip(METHODS, (0.2, 1.5, 3.0), strict=True)
        for x in (0.0, 0.25, 1.0, 4.0)
        for s in range(seeds)
    ]


@settings(max_examples=5, deadline=None)
@given(order=st.randoms())
def test_the_order_of_rows_does_not_matter(order: Any) -> None:
    shuffled = rows()
    order.shuffle(shuffled)
    assert summarise(shuffled) == summarise(rows())


def test_other_references() -> None:
    found = summarise(rows(), references=("contact",))
    assert {p.reference for p in found.pairs} == {"contact"}
    with pytest.raises(InputError, match="twice"):
        summarise([*rows(), rows()[0]])
