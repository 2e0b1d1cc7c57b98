"""The search among free directions: least distance, even points, contacts that stay."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench import Observation
from apo_bench.assembly import build_contact_equations
from apo_bench.geometry import Array
from apo_bench.trial.free_directions import FreeSpace, find_free_space, find_nearest_fitting_poses, find_shortest_above
from tests import scenes


def is_uncorrected(scene: scenes.Scene) -> Observation:
    n = len(scene.nominal_poses)
    return Observation(
        scene.assembly,
        scene.start,
        scene.nominal_poses,
        np.tile(np.diag([1e-6] * 3 + [3e-4] * 3), (n, 1, 1)),
        np.ones(n, bool),
    )


def space_of(scene: scenes.Scene) -> FreeSpace:
    found = find_free_space(is_uncorrected(scene), scene.nominal_poses)
    assert found is not None
    return found


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10_000), rows=st.integers(1, 4))
def test_the_shortest_point_satisfies_all_and_is_shortest(seed: int, rows: int) -> None:
    """By its optimality: it is a combination of the rows that it just meets, with factors that are not negative."""
    rng = np.random.default_rng(seed)
    G = rng.normal(size=(rows, 5))
    h = rng.normal(size=rows)
    x = find_shortest_above(G, h)
    assert x is not None
    assert (G @ x >= h - 1e-8).all()
    met = np.abs(G @ x - h) < 1e-8
    factors = np.linalg.lstsq(G[met].T, x, rcond=None)[0] if met.any() else np.zeros(0)
    np.testing.assert_allclose(G[met].T @ factors, x, atol=1e-7)
    assert (factors > -1e-7).all()


@pytest.mark.parametrize("name", ["subassembly_on_castles", "pockets"])
def test_contacts_hold_wherever_free_directions_lead(name: str) -> None:
    scene = scenes.ALL[name]()
    rng = np.random.default_rng(3)
    space = space_of(scene)
    np.testing.assert_allclose(space.move_along_tangent(np.zeros(len(space))), scene.nominal_poses, atol=1e-15)
    for _ in range(3):
        s = 3.0 * rng.normal(size=len(space))
        goals = space.place(s)
        assert goals is not None
        assert build_contact_equations(scene.assembly, scene.start, goals).gaps(goals).max() < 1e-9
        np.testing.assert_allclose(goals[:, :3, 3], space.move_along_tangent(s)[:, :3, 3], atol=3e-3)


def test_where_linearising_leads_nowhere_even_points_are_tried_and_the_way_back_is_gone() -> None:
    space = space_of(scenes.stick_in_tower())

    def flat(goals: Array) -> Array:
        far = 1e3 * np.abs(goals - space.poses)[:, :3, 3].max()
        return np.array([1.0 if far < 1.0 else -1.0])

    found = find_nearest_fitting_poses(space, lambda goals: True, flat)
    assert found is not None
    assert 1.0 <= 1e3 * np.abs(found - space.poses)[:, :3, 3].max() < 1.5
    assert find_nearest_fitting_poses(space, lambda goals: False, flat) is None
