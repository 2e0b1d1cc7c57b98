"""What a hypothesis chose freely is no evidence: its test, and exchanges between parts of any shape."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from apo_bench import Demonstration, draw_layout, load_scenario
from apo_bench.assembly import Observation
from apo_bench.correction.correctors import correct
from apo_bench.perception.observation.noise import NoiseLevel, make_noise
from apo_bench.perception.observation.observe import observe


def observed(name: str, level: float) -> tuple[Observation, np.ndarray]:
    scenario = load_scenario(name)
    layout = draw_layout(scenario, np.random.default_rng(5), 0.0)
    exact = np.zeros((len(layout.poses), 6, 6))
    shown = Demonstration(scenario.assembly, layout.start, layout.poses, layout.start, exact)
    noise = make_noise("isotropic", NoiseLevel(level, level))
    return observe(shown, noise, np.random.default_rng(6)), layout.poses


def test_the_p_value_after_a_shift_does_not_depend_on_its_length() -> None:
    seen, _ = observed("stick_on_castles", 1.0)
    p_values = []
    for far_m in (0.04, 0.12):
        poses = seen.poses.copy()
        poses[1, :3, 3] += far_m * np.array([0.6, 0.0, 0.8])
        made = correct(replace(seen, poses=poses), "contact-robust")
        assert "too near or too far" in made.sentence
        assert made.test_after is not None
        p_values.append(made.test_after.p_value)
    assert p_values[0] == pytest.approx(p_values[1], abs=1e-3)


def test_parts_of_other_shape_are_exchanged_too() -> None:
    """The first castle has a twin, but is confused with the stick."""
    seen, truth = observed("stick_on_castles", 0.5)
    poses = seen.poses.copy()
    poses[[0, 2]] = poses[[2, 0]]
    made = correct(replace(seen, poses=poses), "contact-robust")
    assert "in each other's place: operation 1, 3" in made.sentence
    assert np.abs(made.poses[:, :3, 3] - truth[:, :3, 3]).max() < 5e-3
