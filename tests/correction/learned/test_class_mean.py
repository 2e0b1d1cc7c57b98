"""The mean error of a class of parts: learned from pairs, taken off before contacts correct."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from apo_bench import correct, load_scenario
from apo_bench.correction.learned.class_mean import ClassMean, class_mean
from apo_bench.geometry import pose
from apo_bench.trial.outcome_columns import goal_errors
from tests.correction.learned.test_learned import seen

RNG = np.random.default_rng(35)
OFF = {part: RNG.normal(size=6) * 2e-3 for part in ("castle1", "castle2", "stick")}


def off(mains: list[str]) -> np.ndarray:
    return pose.exp(np.array([OFF[main] for main in mains]))


def test_a_constant_error_is_learned_and_taken_off_where_contacts_leave_parts_free() -> None:
    assembly = load_scenario("stick_in_tower").assembly
    mains = [operation.main for operation in assembly.operations]
    truth, exact = seen("stick_in_tower", 0, 0.0)
    twists = RNG.normal(size=(400, 3, 6)) * 5e-4
    goals = truth @ off(mains) @ pose.exp(twists)
    goals[::9, 1, :3, 3] += 0.1  # outliers
    there = np.ones((400, 3), dtype=bool)
    there[::7, 2] = False
    goals[~there] = np.eye(4)
    learned = class_mean(assembly, goals, np.tile(truth, (400, 1, 1, 1)), there)
    for part, twist in OFF.items():
        assert learned.twists[part] == pytest.approx(twist, abs=2e-4)
    observation = replace(exact, goals=truth @ off(mains), covariance=np.tile(np.eye(6) * 4e-6, (3, 1, 1)))
    errors = [
        goal_errors(assembly, observation.start, truth, correct(observation, corrector).goals)[1]
        for corrector in (learned, "contact-robust")
    ]
    assert errors[0] < 0.1 * errors[1]
    again = correct(observation, pickle.loads(pickle.dumps(learned)))
    assert np.array_equal(again.goals, correct(observation, learned).goals)


def test_what_nobody_knows_and_what_was_not_seen_stays_as_it_is() -> None:
    _, observation = seen("stick_in_tower", 1)
    assert np.array_equal(correct(observation, ClassMean({})).goals, correct(observation, "contact-robust").goals)
    blind = replace(observation, seen=np.array([True, True, False]))
    found = correct(blind, ClassMean({"stick": OFF["stick"]}))
    assert np.array_equal(found.goals, correct(blind, "contact-robust").goals)
