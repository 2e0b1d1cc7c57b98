"""The river by hand: the exported verbs, one after the other, are the trial of the same seed."""

from __future__ import annotations

import numpy as np

import apo_bench

SETTINGS = apo_bench.TrialConfig("stick_in_tower", noise_mm=2.0, noise_deg=2.0, seed=7)


def test_the_verbs_by_hand_give_the_row_of_the_trial(tower: apo_bench.Scene) -> None:
    layout_rng, human_rng, noise_rng = (np.random.default_rng([SETTINGS.seed, stage]) for stage in range(3))
    layout = apo_bench.draw_layout(tower.scenario, layout_rng)
    demonstration = apo_bench.demonstrate(tower, layout, SETTINGS.human_error_scale, human_rng)
    observation = apo_bench.observe(demonstration, "isotropic", noise_rng, noise_level=2.0)
    correction = apo_bench.correct(observation)
    result = apo_bench.replay(correction.plan(observation), tower)
    verdict = apo_bench.judge(observation.assembly, result.reached, layout.poses, tower.criteria)
    row = apo_bench.run_trial(SETTINGS, tower)
    found = verdict.rests_on
    assert verdict.success
    assert (verdict.success, verdict.as_demonstrated) == (row["success"], row["as_demonstrated"])
    assert (found.gap_mm, found.angle_deg, found.overlap) == (
        row["worst_gap_mm"],
        row["worst_angle_deg"],
        row["least_overlap"],
    )
    assert (result.sim_time_s, result.peak_force_n) == (row["sim_time_s"], row["peak_force_n"])
    assert 1e3 * correction.gap_after_m == row["gap_after_mm"]
