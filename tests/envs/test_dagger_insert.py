"""The policy that learned from the teacher: mirrors, memory, and what it never looks at."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from apo_bench.envs.dagger_insert import MIRRORS, SHAPES, DaggerInsert, forward, mirror_inputs, predict_error
from apo_bench.envs.policies import POLICIES
from apo_bench.names import resolve
from apo_bench.resources import folder

RNG = np.random.default_rng(35)
WEIGHTS = {
    f"{kind}{i}": RNG.normal(size=shape) / np.sqrt(a)
    for i, (a, b) in enumerate(SHAPES)
    for kind, shape in (("w", (a, b)), ("b", (b,)))
}


def sight() -> dict[str, Any]:
    return {"agent_pos": RNG.normal(size=13), "wrench": RNG.normal(size=6), "plan": RNG.normal(size=19)}


def in_mirror(seen: dict[str, Any], signs: np.ndarray) -> dict[str, Any]:
    agent, plan = seen["agent_pos"].copy(), seen["plan"].copy()
    agent[:6] *= signs
    agent[6:12] *= signs
    plan[12:18] *= signs
    return {"agent_pos": agent, "wrench": seen["wrench"] * signs, "plan": plan}


@pytest.mark.parametrize("signs", MIRRORS)
def test_in_a_mirror_it_does_the_same_in_the_mirror(signs: np.ndarray) -> None:
    here, there = DaggerInsert(WEIGHTS), DaggerInsert(WEIGHTS)
    for _ in range(3):
        seen = sight()
        a, b = here(None, seen), there(None, in_mirror(seen, signs))
        assert b[:6] == pytest.approx(signs * a[:6])
    assert np.abs(a[:6]).max() > 1e-3


def test_it_goes_to_the_mean_place_that_the_network_said() -> None:
    """At the first sight it does what is said; after it, a single word of the network weighs a tenth."""
    student = DaggerInsert(WEIGHTS)
    seen = sight()
    inputs = student.encode(seen)
    across = [0, 1, 3, 4, 5]
    said = np.clip(predict_error(WEIGHTS, inputs), -1.0, 1.0)
    assert student.act(seen, inputs)[across] == pytest.approx(said[across])
    other = student.encode(sight())
    mixed = 0.9 * predict_error(WEIGHTS, inputs) + 0.1 * predict_error(WEIGHTS, other)
    assert student.act(seen, other)[across] == pytest.approx(np.clip(mixed, -1.0, 1.0)[across])
    assert forward(WEIGHTS, mirror_inputs(inputs)).shape == (4, 6)


def test_weights_are_small_and_come_along() -> None:
    assert (folder("assets") / "learned" / "insert.npz").stat().st_size < 4e6
    said = resolve("dagger-insert", POLICIES, "policy")()(None, sight())
    assert np.isfinite(said).all()
