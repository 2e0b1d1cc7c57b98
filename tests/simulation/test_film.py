"""What happened in a replay, kept moment by moment and written around the pictures of a film."""

import numpy as np

from apo_bench import Plan, build_scene, demonstrate, draw_layout, load_scenario, replay
from apo_bench.simulation.execution import ExecutionConfig
from apo_bench.simulation.film.film import frames, operation_words, sample_moments
from apo_bench.simulation.film.track import FilmMoment, FilmTrack, Segment
from apo_bench.simulation.hooks import BY_HAND, TOUCHING, Phase


def moments(*forces: float) -> list[FilmMoment]:
    """Moments of operations 1, 1, .., 2, 20 ms apart."""
    operations = [0] * (len(forces) - 1) + [1]
    pairs = zip(operations, forces, strict=True)
    return [FilmMoment(0.02 * i, np.zeros(1), Phase(k, "carry", f), np.zeros((0, 3))) for i, (k, f) in enumerate(pairs)]


def test_a_force_between_two_pictures_is_written_on_the_next() -> None:
    samples = [(round(m.time_s / 0.02), f, most) for m, f, most in sample_moments(moments(0, 1, 7, 2, 1, 0, 0.5), 0.08)]
    assert samples == [(0, 0, 0), (4, 7, 7), (6, 0.5, 0.5)]


def test_a_trial_is_captioned_by_operation() -> None:
    scene = build_scene(load_scenario("block_on_block"))
    layout = draw_layout(scene.scenario, np.random.default_rng(0), scene.clearance_mm)
    assembly = scene.scenario.assembly
    track = FilmTrack()
    hands = FilmTrack()
    plan = Plan(assembly, layout.start, layout.poses)
    assert replay(plan, scene, track.hooks, config=ExecutionConfig("near-contact")).outcome.code == "ok"
    assert track.plan is plan
    order = list(dict.fromkeys((m.phase.operation, m.phase.macro) for m in track.moments if m.phase.operation == 1))
    assert order == [(1, stage) for stage in ("pick", "lift", "carry", "move-to-contact", "release", "depart")]
    landed = [m.phase for m in track.moments if m.phase.macro == "move-to-contact"]
    assert max(phase.force_n for phase in landed) > 1.0
    assert operation_words(assembly, track.moments[-1]).startswith("operation 2 of 2")
    first = track.moments[0]
    assert operation_words(assembly, first) == "at the start"
    touching = first._replace(phase=Phase(None, TOUCHING, 0.0))
    assert operation_words(assembly, touching) == "the closed hand touches what is fixed"

    demonstrate(scene, layout, 0.0, np.random.default_rng(1), hands.hooks)
    assert {m.phase for m in hands.moments} == {Phase(k, BY_HAND, 0.0) for k in (None, 0, 1)}
    end = np.array(hands.moments[-1].qpos)
    segment = Segment("shown", scene.shown, layout.start, (hands.moments[0], hands.moments[-1]), "done", None)
    drawn = [picture for picture, _ in frames(assembly, layout.start, [segment])]
    assert drawn[0].shape == drawn[-1].shape
    assert np.abs(drawn[0].astype(int) - drawn[1]).max() > 50
    assert np.array_equal(end, hands.moments[-1].qpos)
