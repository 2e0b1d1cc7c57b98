"""Parts of revolution: which are, and the turn that brings one nearest to where it should be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench.geometry import Box, Solid, pose, revolution, turned_alike
from tests import rounds, scenes


@pytest.mark.parametrize(
    ("part", "reversible"),
    [
        (rounds.peg(), True),
        (rounds.bush(), True),
        (rounds.plug(), False),
        (rounds.plate(), None),
        (rounds.countersunk(), None),
        (scenes.cube(), None),
        (scenes.table(), None),
    ],
    ids=lambda given: given.name if isinstance(given, Solid) else str(given),
)
def test_which_parts_are_of_revolution(part: Solid, reversible: bool | None) -> None:
    found = revolution(part)
    assert (None if found is None else found.reversible) == reversible
    if found is not None:
        assert abs(found.axis[2]) == pytest.approx(1.0)


def test_a_key_on_a_shaft_or_a_wall_off_its_axis_is_seen() -> None:
    peg = rounds.peg()
    key = Box("key", np.array([0.005, 0.0, 0.02]), np.array([0.002, 0.002, 0.002]))
    assert revolution(replace(peg, pieces=(*peg.pieces, key))) is None
    off = replace(peg.rounds["wall"], point=np.array([1e-4, 0.0, 0.0]))
    assert revolution(replace(peg, rounds={**peg.rounds, "wall": off})) is None


def test_a_shaft_with_one_fit_end_is_not_the_same_end_for_end() -> None:
    peg = rounds.peg()
    fit = replace(peg, faces={**peg.faces, "end": replace(peg.faces["end"], fit=True)})
    found = revolution(fit)
    assert found is not None
    assert not found.reversible


@given(st.integers(0, 10**6), st.sampled_from([rounds.peg(), rounds.plug()]))
@settings(max_examples=30, deadline=None)
def test_the_turn_is_the_least_there_is(seed: int, part: Solid) -> None:
    """No other turn about the axis, nor end for end where that is allowed, leaves less between the two poses."""
    rng = np.random.default_rng(seed)
    found = revolution(part)
    assert found is not None
    T = pose.exp(rng.standard_normal(6))
    true = pose.exp(rng.standard_normal(6))
    best = turned_alike(part, T, true)

    def turn(X: np.ndarray) -> float:
        return float(np.linalg.norm(pose.log(pose.inverse(true) @ X)[3:]))

    c = pose.at(found.point)
    flips = [np.eye(4), pose.at((0, 0, 0), (180, 0, 0))] if found.reversible else [np.eye(4)]
    others = [
        T @ c @ flip @ pose.at((0, 0, 0), (0, 0, angle)) @ pose.inverse(c)
        for flip in flips
        for angle in np.arange(0.0, 360.0, 1.0)
    ]
    assert turn(best) <= min(map(turn, others)) + 1e-9
    assert min(float(np.abs(best - other).max()) for other in others) < 0.01


def test_any_other_part_stays_as_it_is() -> None:
    T = pose.exp(np.arange(6.0))
    assert turned_alike(scenes.cube(), T, np.eye(4)) is T
