"""Pairs of observation and truth: the numbers of the noise models, and of no trial."""

from __future__ import annotations

import numpy as np
import pytest

from apo_bench import InputError, load_scenario
from apo_bench.assembly import Demonstration, build_contact_equations
from apo_bench.benchmark.datasets import draw_endless_pairs, draw_pairs, training_pairs
from apo_bench.benchmark.datasets.training_pairs import observe_many, observes_by_part
from apo_bench.benchmark.scoring.track import read_tracks
from apo_bench.geometry import pose
from apo_bench.perception.observation.models.symmetric_parts import AnyTurnNoise
from apo_bench.perception.observation.noise import NOISES, NoiseLevel, make_noise
from apo_bench.perception.observation.noise_file import list_presets
from apo_bench.scenario import compute_human_error_covariance, list_scenario_names
from apo_bench.scenario.layout import draw_layouts
from apo_bench.trial.trial_stages import stream

SHARED = {"bias-view", "correlated", "swaps", "displaced-view", "depth-scale", "merged"}
"""What is seen of one part hangs together with what is seen of another."""
KINDS = ["outliers", "bias", "flips", "megapose-lmo", AnyTurnNoise]
"""Of several independent draws: of each look, of each part, of a camera that fails, of a file, of a class."""


def test_models_whose_parts_are_independent_are_drawn_together() -> None:
    assert {
        name for name in (*NOISES, *list_presets()) if not observes_by_part(make_noise(name, NoiseLevel(1.0, 1.0)))
    } == SHARED
    assert not draw_pairs("stick_in_tower", "swaps", 3).together
    assert draw_pairs("stick_in_tower", "bias", 3).together


@pytest.mark.parametrize("noise", [*KINDS, "correlated"])
def test_one_demonstration_is_seen_as_the_noise_model_sees_it(noise: str | type) -> None:
    """Bit for bit: it is the noise model itself that is asked, whether for one or for many."""
    scenario = load_scenario("carried_bridge")
    model = make_noise(noise, NoiseLevel(2.0, 1.0))
    layouts = draw_layouts(scenario, np.random.default_rng(1), 1)
    human_error_scale = compute_human_error_covariance(scenario, 1.0)
    many = observe_many(scenario.assembly, layouts, human_error_scale, model, np.random.default_rng(2))
    start = {part: poses[0] for part, poses in layouts.start.items()}
    one = model(
        scenario.assembly,
        Demonstration(scenario.assembly, start, layouts.poses[0], {}, human_error_scale),
        np.random.default_rng(2),
    )
    assert many.poses[0].tobytes() == one.poses.tobytes()
    assert many.covariance[0].tobytes() == one.covariance.tobytes()
    assert many.observed[0].tobytes() == one.observed.tobytes()


@pytest.mark.parametrize("noise", KINDS)
def test_many_are_distributed_as_one_by_one(noise: str | type, monkeypatch: pytest.MonkeyPatch) -> None:
    """Quartiles of shifts and turns, how often nothing is seen, and how alike two errors of one part are."""

    def drawn() -> np.ndarray:
        many = draw_pairs("carried_bridge", noise, 256, 4, noise_level=2.0, human_error_scale=0.0)
        xi = pose.log(pose.inverse(many.truth) @ many.poses)
        sizes = np.linalg.norm(xi.reshape(256, -1, 2, 3), axis=-1)
        quartiles = np.quantile(sizes[many.observed], [0.25, 0.5, 0.75], axis=0)
        stated = np.sqrt(np.median(np.diagonal(many.covariance, axis1=2, axis2=3), axis=0)[:, [0, 3]])
        parts = [operation.main for operation in load_scenario("carried_bridge").assembly.operations]
        first, again = next((parts.index(part), k) for k, part in enumerate(parts) if part in parts[:k])
        alike = np.corrcoef(np.log(1e-9 + sizes[:, first, 0]), np.log(1e-9 + sizes[:, again, 0]))[0, 1]
        return np.array([*np.log(quartiles).ravel(), *np.log(stated).ravel(), 3.0 * many.observed.mean(), alike])

    together = drawn()
    monkeypatch.setattr("apo_bench.benchmark.datasets.training_pairs.observes_by_part", lambda noise: False)
    np.testing.assert_allclose(together, drawn(), atol=0.3)


@pytest.mark.parametrize("name", ["pocket_table", "gearbox", "dovetail"])
def test_every_contact_of_the_truth_holds(name: str) -> None:
    scenario = load_scenario(name)
    layouts = draw_layouts(scenario, training_pairs.make_block_generator(0, name, 0), 2)
    many = draw_pairs(name, n=2)
    np.testing.assert_array_equal(many.truth, layouts.poses)
    for i, goals in enumerate(many.truth):
        start = {part: poses[i] for part, poses in layouts.start.items()}
        assert np.abs(build_contact_equations(scenario.assembly, start, goals).gaps(goals)).max() < 1e-9


def test_more_pairs_begin_with_the_same_ones() -> None:
    few = draw_pairs("dovetail", "outliers", 5, 7, noise_level=(1.0, 2.0))
    many = draw_pairs("dovetail", "outliers", training_pairs.BLOCK + 5, 7, noise_level=(1.0, 2.0))
    blocks = draw_endless_pairs("dovetail", "outliers", 7, noise_level=(1.0, 2.0))
    first, second = next(blocks), next(blocks)
    for name in ("poses", "covariance", "observed", "truth"):
        np.testing.assert_array_equal(getattr(many, name)[:5], getattr(few, name))
        joined = np.concatenate([getattr(first, name), getattr(second, name)[:5]])
        np.testing.assert_array_equal(joined, getattr(many, name))
    assert not np.array_equal(first.truth, second.truth)
    assert not np.array_equal(draw_pairs("dovetail", n=5, seed=8).truth, few.truth)


def test_no_stream_of_chance_is_one_of_a_trial() -> None:
    """Trials have no spawn key, whatever their seed, stage and salt are; and no number of theirs comes again."""
    assert stream(3, 0).bit_generator.seed_seq.spawn_key == ()  # type: ignore[attr-defined]
    most = max(grid.trials for track in read_tracks(()) for grid in track.grids)
    drawn = [stream(seed, which).random() for seed in range(max(most, 100)) for which in range(12)]
    ours = [
        training_pairs.make_block_generator(seed, name, block).random()
        for seed in range(20)
        for name in list_scenario_names()
        for block in range(3)
    ]
    assert len({*drawn, *ours}) == len(drawn) + len(ours)


@pytest.mark.parametrize(
    ("given", "complaint"),
    [({"scenarios": []}, "no scenario was given"), ({"scenarios": "dovetial"}, "unknown scenario 'dovetial'")],
)
def test_what_is_wrong_is_said(given: dict[str, object], complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        draw_pairs(**given)  # type: ignore[arg-type]
