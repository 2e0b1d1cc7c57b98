"""Contacts recognised from seen poses: all of them, no other, and nothing but poses, solids and noise is used."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from apo_bench import Assembly, Observation, detect_contacts, draw_layout, load_scenario
from apo_bench.assembly import Contact, FacingPair, Operation, compute_placements
from apo_bench.assembly.facing_pairs import find_facing_pairs
from apo_bench.geometry import Solid, pose
from apo_bench.perception.detection.kalman_filter import PoseBelief, make_initial_belief
from apo_bench.perception.detection.thresholds import RULES_BY_NOISE, Rules
from apo_bench.perception.observation.models.displacement import floor_covariance
from apo_bench.scenario.scenario_file import list_scenario_names
from tests import scenes

NAMES = sorted(scenes.ALL)
WIDE = {"gap_m": 0.02, "angle_rad": 0.5, "share": 0.1}


def contacts(assembly: Assembly) -> set[tuple[int, Contact]]:
    return {(relation.made, relation.contact) for relation in assembly.relations()}


def seen_at(scene: scenes.Scene, seed: int, noise_level: float, play_m: float = 0.0) -> Observation:
    """Goals with noise of so many mm and degrees, which are stated."""
    goals = scenes.noisy(scene.nominal_poses, np.random.default_rng(seed), noise_level, noise_level)
    return stated(scenes.seen(scene, goals), noise_level, play_m)


def stated(seen: Observation, noise_level: float, play_m: float = 0.0) -> Observation:
    covariance = np.tile(
        np.diag(np.repeat([noise_level * 1e-3, np.radians(noise_level)], 3) ** 2), (len(seen.poses), 1, 1)
    )
    return replace(seen, covariance=floor_covariance(covariance), play_m=play_m)


def blocks(apart_mm: float, noise_level: float) -> Observation:
    """Two blocks on the table, one this far beside the other."""
    solids = [scenes.table(), scenes.block("A"), scenes.block("B")]
    operations = [Operation("A"), Operation("B")]
    scene = scenes.scene(solids, operations, [scenes.mm(0, 0, 25), scenes.mm(50 + apart_mm, 0, 25)])
    return stated(scenes.seen(scene, scene.nominal_poses), noise_level)


def side_by_side(seen: Observation, rules: Rules = RULES_BY_NOISE) -> bool:
    return any(str(e.contact) == "B.nx on A.px" for e in detect_contacts(seen, rules).evidence)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("noise_level", [pytest.param(0.0, marks=pytest.mark.numeric), 0.5, 1.0])
def test_every_contact_is_recognised_and_no_other(name: str, noise_level: float) -> None:
    """Rounding can only decide where there is no noise."""
    scene = scenes.ALL[name]()
    for seed in range(3):
        recognised = detect_contacts(seen_at(scene, seed, noise_level))
        assert contacts(recognised.assembly) == contacts(scene.assembly)
        assert tuple(e.contact for e in recognised.evidence) == tuple(
            r.contact for r in recognised.assembly.relations()
        )


@pytest.mark.parametrize("name", list_scenario_names())
def test_scenarios_of_the_package_are_recognised_with_their_own_play(name: str) -> None:
    """Layouts as they are drawn; physics is left to the benchmark."""
    scenario = load_scenario(name)
    for seed in range(3):
        layout = draw_layout(scenario, np.random.default_rng(seed))
        scene = scenes.Scene(scenario.assembly, layout.start, layout.poses)
        seen = seen_at(scene, seed, 0.5, play_m=scenario.clearance_mm * 1e-3)
        assert contacts(detect_contacts(seen).assembly) == contacts(scenario.assembly)


@pytest.mark.parametrize("name", ["stick_in_tower", "subassembly_on_castles", "fixture", "pockets"])
def test_a_part_that_was_put_aside_still_touches_what_it_touches(name: str) -> None:
    """The carelessness is stated, so a gap of 3 mm is explained; where nothing states it, it is not."""
    scene, goals = scenes.human_error(name, 3.0)
    exact = stated(scenes.seen(scene, goals), 0.1)
    along = 0 if name == "pockets" else 1
    wide = np.array(exact.covariance)
    aside = [1, 2] if name == "fixture" else [1]
    wide[aside, along, along] += 2.85e-3**2
    assert contacts(detect_contacts(replace(exact, covariance=wide)).assembly) == contacts(scene.assembly)
    assert contacts(detect_contacts(exact).assembly) < contacts(scene.assembly)


@pytest.mark.numeric
@pytest.mark.parametrize("name", NAMES)
def test_the_world_frame_does_not_matter(name: str) -> None:
    scene = scenes.ALL[name]()
    T = pose.exp([0.3, -0.2, 0.1, 0.4, -0.9, 1.3])
    for seed in (7, 8):
        here = seen_at(scene, seed, 1.0)
        there = seen_at(scenes.turned(scene, T), seed, 1.0)
        found = detect_contacts(here).evidence
        again = detect_contacts(there).evidence
        assert [(e.made, e.contact) for e in found] == [(e.made, e.contact) for e in again]
        assert_allclose([e.gap_m for e in found], [e.gap_m for e in again], rtol=0, atol=1e-7)
        assert_allclose([e.largest_distance for e in found], [e.largest_distance for e in again], rtol=1e-4, atol=1e-7)


def test_what_counts_as_near_follows_the_noise_up_to_a_bound() -> None:
    assert side_by_side(blocks(0.2, 0.1))
    assert not side_by_side(blocks(3.0, 0.1))
    assert side_by_side(blocks(3.0, 1.0))
    assert not side_by_side(blocks(9.0, 1.0))
    assert side_by_side(blocks(9.0, 4.0))
    assert not side_by_side(blocks(12.0, 10.0))
    assert side_by_side(blocks(-3.0, 1.0))


def test_of_contacts_that_exclude_each_other_those_are_taken_that_fit_together() -> None:
    """A cube that is seen 4.5 mm too low on a castle is nearly as near to the floor of the slot."""
    scene = scenes.subassembly_on_castles()
    goals = np.array(scene.nominal_poses)
    goals[2, 2, 3] -= 4.5e-3
    found = detect_contacts(stated(scenes.seen(scene, goals), 2.0))
    of_cube = {str(e.contact) for e in found.evidence if e.made == 2}
    assert of_cube == {"cube.nz on castle1.topP", "cube.nz on castle1.topN"}


def pairs(scene: scenes.Scene, seed: int) -> list[tuple[str, str, FacingPair]]:
    """Faces that look at each other, between all parts at the end of a noisy demonstration."""
    goals = scenes.noisy(scene.nominal_poses, np.random.default_rng(seed), 1.0, 1.0)
    at = compute_placements(scene.assembly, scene.start, goals)[-1]
    solids = scene.assembly.solids
    return [
        (a, b, pair)
        for a in solids
        for b in solids
        if a != b
        for pair in find_facing_pairs(solids[a], at[a], solids[b], at[b], **WIDE)
    ]


@pytest.mark.numeric
@pytest.mark.parametrize("name", ["stick_in_tower", "pockets"])
def test_the_derivative_of_gap_and_tilts_is_right(name: str) -> None:
    """Central differences. Where parts turn the overlap changes too, so the gap is taken where its middle was."""
    scene = scenes.ALL[name]()
    goals = scenes.noisy(scene.nominal_poses, np.random.default_rng(3), 1.0, 1.0)
    at = compute_placements(scene.assembly, scene.start, goals)[-1]
    solids = scene.assembly.solids
    h = 1e-6
    found = pairs(scene, 3)
    assert len(found) > 10
    for a, b, pair in found:
        corner = solids[a].faces[pair.a].outline[:1]
        normal = solids[a].faces[pair.a].normal
        middle = middle_of(pair, at[a], corner, normal)
        for i in range(6):
            posed = [pose.exp(sign * h * np.eye(6)[i]) @ at[a] for sign in (1.0, -1.0)]
            ends = [same(pair, solids[a], T, solids[b], at[b]).residual[1:] for T in posed]
            assert_allclose((ends[0] - ends[1]) / (2 * h), pair.slope[1:, i], rtol=0, atol=1e-6)
            gaps = [(T[:3, :3] @ normal) @ (middle - pose.apply(T, corner)[0]) for T in posed]
            assert (gaps[0] - gaps[1]) / (2 * h) == pytest.approx(pair.slope[0, i], abs=1e-6)


def middle_of(pair: FacingPair, T_a: np.ndarray, corner: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """The point at which the gap is taken, from the derivative -(n, m x n) and the gap itself."""
    n = T_a[:3, :3] @ normal
    return np.cross(n, -pair.slope[0, 3:]) + (n @ pose.apply(T_a, corner)[0] + pair.gap_m) * n


def same(pair: FacingPair, a: Solid, T_a: np.ndarray, b: Solid, T_b: np.ndarray) -> FacingPair:
    return next(p for p in find_facing_pairs(a, T_a, b, T_b, **WIDE) if (p.a, p.b) == (pair.a, pair.b))


@pytest.mark.numeric
@pytest.mark.parametrize("name", NAMES)
def test_what_errors_of_goals_do_to_parts_is_right(name: str) -> None:
    scene = scenes.ALL[name]()
    belief = make_initial_belief(seen_at(scene, 4, 1.0))
    rng = np.random.default_rng(0)
    h = 1e-6
    for k in range(len(scene.assembly)):
        now = belief.parts_after(k)
        for part, T in compute_placements(scene.assembly, scene.start, belief.poses)[k].items():
            assert_allclose(now.poses[part], T, rtol=0, atol=1e-12)
        xi = rng.standard_normal(6 * len(belief.poses))
        ends = [
            PoseBelief(
                belief.assembly, belief.start, belief.poses @ pose.exp(s * h * xi.reshape(-1, 6)), belief.covariance
            )
            for s in (1.0, -1.0)
        ]
        after = [end.parts_after(k).poses for end in ends]
        for part, reach in now.reach.items():
            moved = pose.log(after[0][part] @ pose.inverse(after[1][part])) / (2 * h)
            assert_allclose(reach @ xi, moved, rtol=0, atol=1e-6)


@pytest.mark.numeric
@settings(deadline=None, max_examples=50)
@given(seed=st.integers(0, 2**32 - 1))
def test_learning_of_contacts_is_conditioning_a_gaussian(seed: int) -> None:
    """Two measurements one after the other leave the same covariance as both at once, and less than before."""
    rng = np.random.default_rng(seed)
    belief = make_initial_belief(seen_at(scenes.bridge(), 0, 1.0))
    n = len(belief.covariance)
    rows = [rng.standard_normal((3, n)) * np.tile(np.repeat([1.0, 0.05], 3), n // 6) for _ in range(2)]
    noise = np.diag([1e-4, 2e-3, 2e-3]) ** 2
    after = belief
    for J in rows:
        after = after.update(np.zeros(3), J, noise)
    J = np.concatenate(rows)
    R = np.kron(np.eye(2), noise)
    P = belief.covariance
    expected = P - P @ J.T @ np.linalg.solve(J @ P @ J.T + R, J @ P)
    scale = np.sqrt(np.outer(np.diag(P), np.diag(P)))
    assert_allclose(after.covariance / scale, expected / scale, rtol=0, atol=1e-9)
    assert np.all(np.diag(after.covariance) <= np.diag(P) * (1 + 1e-9))
    assert_allclose(after.poses, belief.poses, rtol=0, atol=0)
