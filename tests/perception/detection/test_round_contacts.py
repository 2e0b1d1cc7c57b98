"""Contacts of round faces, recognised from seen poses as those of flat ones are."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose

from apo_bench import detect_contacts
from apo_bench.assembly import FacingPair, classify_contact, compute_placements, find_round_pairs, measure_round_pair
from apo_bench.assembly.facing_pairs import find_facing_pairs
from apo_bench.geometry import Array, Face, RoundFace, pose
from apo_bench.perception.detection.thresholds import (
    Rules,
    compute_contact_covariance,
    compute_contact_slack,
    compute_pair_thresholds,
)
from tests import rounds, scenes
from tests.brackets import on_pins, under_roof
from tests.perception.detection.test_contacts import contacts, seen_at, stated

SCENES = {**rounds.ALL, "on_pins": on_pins, "under_roof": under_roof}


@lru_cache
def built(name: str) -> scenes.Scene:
    return SCENES[name]()


@pytest.mark.parametrize("name", sorted(SCENES))
@pytest.mark.parametrize("noise_level", [pytest.param(0.0, marks=pytest.mark.numeric), 0.5])
def test_every_contact_is_recognised_and_no_other(name: str, noise_level: float) -> None:
    scene = built(name)
    for seed in range(3):
        recognised = detect_contacts(seen_at(scene, seed, noise_level, play_m=0.1e-3))
        assert contacts(recognised.assembly) == contacts(scene.assembly)
        assert tuple(e.contact for e in recognised.evidence) == tuple(
            r.contact for r in recognised.assembly.relations()
        )


@pytest.mark.parametrize(("radius", "fits"), [(4.3, False), (4.5, True), (5.0, True), (5.05, True), (5.2, False)])
def test_radii_must_fit(radius: float, fits: bool) -> None:
    plate = rounds.plate()
    peg = rounds.peg(radius=radius)
    pairs = {(a.name, b.name) for a, b in find_round_pairs(peg, plate)}
    assert (("wall", "bore") in pairs) is fits


def test_a_peg_beside_its_bore_is_not_in_it() -> None:
    """What counts as near follows the noise; a peg on its end has no length in common with the bore below it."""
    scene = built("loose_peg")
    for aside_mm, above_mm, within in ((0.3, 0, True), (2.5, 0, False), (0.0, 18, False)):
        goals = np.array(scene.nominal_poses)
        goals[1, :3, 3] += [1e-3 * aside_mm, 0.0, 1e-3 * above_mm]
        recognised = detect_contacts(stated(scenes.seen(scene, goals), 0.2))
        assert any(str(e.contact) == "peg.wall on plate.bore" for e in recognised.evidence) is within


class Pair(NamedTuple):
    """Two posed faces, at least one of them round."""

    one: Face | RoundFace
    T_one: Array
    other: Face | RoundFace
    T_other: Array
    found: FacingPair


def pairs_of(name: str, turned_deg: float = 1.0) -> list[Pair]:
    """Those that look at each other at the end of a noisy demonstration, in both orders."""
    scene = built(name)
    goals = scenes.noisy(scene.nominal_poses, np.random.default_rng(3), 0.5, turned_deg)
    at = compute_placements(scene.assembly, scene.start, goals)[-1]
    solids = scene.assembly.solids
    faces = {part: {**solid.faces, **solid.rounds} for part, solid in solids.items()}
    return [
        Pair(faces[a][pair.a], at[a], faces[b][pair.b], at[b], pair)
        for a in solids
        for b in solids
        if a != b
        for pair in find_facing_pairs(solids[a], at[a], solids[b], at[b], gap_m=0.02, angle_rad=0.5, share=0.1)
        if pair.a in solids[a].rounds or pair.b in solids[b].rounds
    ]


@pytest.mark.numeric
@pytest.mark.parametrize("name", ["through", "in_groove", "countersink", "on_rim"])
def test_the_derivative_is_right(name: str) -> None:
    """Central differences by twists of the first part.

    Where parts are tilted the middle of what they have in common moves along as they turn, so lengths are looked at
    where they are only shifted.
    """
    h = 1e-6
    for turned_deg in (0.0, 1.0):
        pairs = pairs_of(name, turned_deg)
        assert len(pairs) >= 2
        for one, T_one, other, T_other, pair in pairs:
            rows = slice(0, None) if turned_deg == 0.0 else slice(pair.lengths, None)
            for i in range(6):
                posed = [pose.exp(sign * h * np.eye(6)[i]) @ T_one for sign in (1.0, -1.0)]
                ends = [measure_round_pair(one, T, other, T_other).residual for T in posed]
                assert_allclose((ends[0] - ends[1])[rows] / (2 * h), pair.slope[rows, i], rtol=0, atol=1e-6)


COUNTS = {"shaft in hole": (2, 2), "shaft on plane": (1, 1), "cone in cone": (3, 2), "cone on rim": (3, 0)}


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("peg_in_plate", "shaft in hole"),
        ("in_groove", "shaft on plane"),
        ("countersink", "cone in cone"),
        ("on_rim", "cone on rim"),
    ],
)
def test_as_many_numbers_as_equations_and_as_rarely_missed_as_is_said(name: str, kind: str) -> None:
    """Of 20000 residuals drawn from a covariance, as many are beyond the thresholds as `miss_rate` says."""
    pair = next(p.found for p in pairs_of(name) if classify_contact(p.one, p.other) == kind)
    lengths, tilts = COUNTS[kind]
    assert (pair.lengths, len(pair.residual) - pair.lengths, len(pair.half_m)) == (lengths, tilts, tilts)
    sigma = np.array([2e-3] * lengths + [np.radians(1.0)] * tilts)
    rules = Rules(miss_rate=0.01, gap_m=0.1, angle_rad=1.0)
    most = compute_pair_thresholds(rules, np.diag(sigma**2), compute_contact_slack(pair, 0.0), pair.lengths)
    draws = np.random.default_rng(0).standard_normal((20000, len(sigma))) * sigma
    beyond = [_longer(draws[:, :lengths], most.gap_m), _longer(draws[:, lengths:], most.angle_rad)]
    assert beyond[0] == pytest.approx(0.01, abs=0.003)
    assert beyond[1] == (pytest.approx(0.01, abs=0.003) if tilts else 0.0)
    assert np.mean(((draws / sigma) ** 2).sum(axis=1) > rules.largest_explained(len(sigma))) == pytest.approx(
        0.01, abs=0.003
    )
    assert np.all(np.linalg.eigvalsh(compute_contact_covariance(pair, 0.1e-3)) > 0)


def _longer(draws: Array, most: float) -> float:
    return float(np.mean(np.linalg.norm(draws, axis=1) > most))
