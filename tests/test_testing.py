"""The sequential test errs as seldom as it says, and stops early; a method is held against what is asked."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from apo_bench.testing import assert_success_rate, sequential_test

EASY = {"scenario": "block_on_block", "noise_mm": 1.0, "noise_deg": 1.0, "grasp": "weld"}


def rates(p: float, rng: np.random.Generator, n: int = 2000) -> tuple[float, float]:
    """How often a method with this rate passes, and the mean number of trials."""
    ends = [sequential_test((bool(rng.random() < p) for _ in itertools.count()), 0.95, 0.15, 0.02) for _ in range(n)]
    return float(np.mean([end.passed for end in ends])), float(np.mean([end.trials for end in ends]))


def test_it_errs_as_seldom_as_it_says_and_stops_early() -> None:
    rng = np.random.default_rng(0)
    passed, trials = rates(0.95, rng)
    assert passed >= 0.98 - 4.0 * np.sqrt(0.02 * 0.98 / 2000)  # four standard deviations of what is counted
    assert trials < 70
    passed, trials = rates(0.80, rng)
    assert passed <= 0.02 + 4.0 * np.sqrt(0.02 * 0.98 / 2000)
    assert trials < 70


def test_a_rate_of_one_is_lost_with_the_first_failure() -> None:
    assert sequential_test(iter([True, True, False]), 1.0, 0.1).sentence == "2 of 3 trials succeeded: it is below 1"
    assert sequential_test(itertools.repeat(True), 1.0, 0.1).passed


def test_where_trials_run_out_the_likelier_rate_decides() -> None:
    ends = sequential_test(itertools.repeat(True), 0.9, 0.1, most=3)
    assert (ends.passed, ends.trials) == (True, 3)
    assert "not decided after 3" in ends.sentence
    assert "not decided" in sequential_test(iter([True, True]), 0.9, 0.1).sentence


def test_a_method_is_held_against_what_is_asked() -> None:
    assert assert_success_rate("contact", EASY, at_least=0.95, margin=0.6, error=0.1).passed
    with pytest.raises(AssertionError, match=r"oracle, \d+ of \d+ trials? succeeded: it is below 0.99"):
        assert_success_rate("oracle", EASY | {"robot_error": "hand_eye:20/5"}, at_least=0.99, margin=0.3, error=0.1)


def test_a_corrector_that_raises_is_named_with_what_it_said() -> None:
    def boom(_: object) -> None:
        raise ValueError("out of luck")

    with pytest.raises(AssertionError, match=r"boom, 0 of \d+ trials? succeeded.*the last failure.*out of luck"):
        assert_success_rate(boom, EASY, at_least=0.9, margin=0.5, error=0.2)  # type: ignore[arg-type]
