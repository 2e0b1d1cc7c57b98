"""`contact` on observations whose errors are shared: the joint estimate, its posterior, what it says of the error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from apo_bench import Demonstration, Observation, correct, draw_layout, load_scenario
from apo_bench.correction.region import contains_truth
from apo_bench.perception.observation.noise import NoiseLevel, make_noise


def shown(name: str, seed: int) -> Demonstration:
    scenario = load_scenario(name)
    layout = draw_layout(scenario, np.random.default_rng(seed), 0.0)
    n = len(layout.poses)
    return Demonstration(scenario.assembly, layout.start, layout.poses, layout.start, np.zeros((n, 6, 6)))


def seen(model: str, name: str = "pocket_table", seed: int = 0, level: float = 2.0) -> tuple[Observation, np.ndarray]:
    demonstration = shown(name, seed)
    made = make_noise(model, NoiseLevel(level, level))(
        demonstration.assembly, demonstration, np.random.default_rng(seed)
    )
    return made, np.array(demonstration.poses)


def test_a_view_error_leaves_parts_to_each_other_as_they_were_seen() -> None:
    """pocket_table: contacts with the fixed table tell where the camera is; taken alone, operations are torn apart."""
    joint = []
    alone = []
    for seed in range(4):
        observation, truth = seen("bias-view", seed=seed)
        for given, errors in ((observation, joint), (replace(observation, shared=()), alone)):
            made = correct(given, "contact")
            assert made.ok
            errors.append(np.linalg.norm(made.poses[:, :3, 3] - truth[:, :3, 3], axis=1).max())
    assert np.mean(joint) < 0.15 * np.mean(alone)


@pytest.mark.parametrize("model", ["bias-view", "correlated"])
def test_the_test_and_the_posterior_are_those_of_the_joint_covariance(model: str) -> None:
    """Of 30 draws 95 % regions cover 28.5 but for chance (binomial, 4 sigma), and p is uniform on average.

    `benchmarks/calibration.py` takes 2,000 draws of every model.
    """
    p = []
    covered = []
    for seed in range(30):
        observation, truth = seen(model, ["pocket_table", "stick_in_tower"][seed % 2], seed)
        made = correct(observation, "contact")
        assert made.ok
        p.append(made.test.p_value)
        covered.append(contains_truth(observation, made, truth))
    assert sum(covered) >= 28.5 - 4 * np.sqrt(30 * 0.95 * 0.05)
    assert np.mean(p) == pytest.approx(0.5, abs=4 / np.sqrt(12 * 30))
