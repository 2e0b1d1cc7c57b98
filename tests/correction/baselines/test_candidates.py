"""The motion parameters that Section 3.3.2 chooses: the paper's own lists, and what holds for any graph."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from apo_bench import Assembly
from apo_bench.assembly import Relation, build_contact_equations
from apo_bench.correction.baselines.candidates import candidates
from tests import scenes
from tests.assembly.test_equations import random_scene

pytestmark = pytest.mark.numeric


def arcs(assembly: Assembly, *ends: str) -> NDArray[np.bool_]:
    """The contacts of these arcs, each as `stick-castle1`, or `cube-table 4` with the operation (from 1)."""
    return np.array([any(_named(relation, given) for given in ends) for relation in assembly.relations()])


def _named(relation: Relation, given: str) -> bool:
    pair, _, made = given.partition(" ")
    manipulated, environment = (end.part for end in relation.contact)
    return pair == f"{manipulated}-{environment}" and made in ("", str(relation.made + 1))


def chosen(assembly: Assembly, *failing: str) -> tuple[int, ...]:
    """Candidates counted from 1, as in the paper."""
    return tuple(k + 1 for k in candidates(assembly, arcs(assembly, *failing)))


PAPER = {
    "bridge": (("A-B", "A-C"), (3, 2, 1)),
    "stick_on_castles": (("stick-castle1", "stick-castle2"), (3, 2, 1)),
    "stick_in_tower": (("stick-castle1", "stick-castle2"), (3, 2, 1)),
    "subassembly_on_castles": (("stick-castle1", "stick-castle2"), (5, 4, 3, 2, 1)),
    "fixture": (("stick-castle1", "stick-castle2"), (5, 3, 2, 1)),
    "pockets": (("cube2-table 6", "cube3-table 6"), (6, 5, 3, 2, 1)),
}


@pytest.mark.parametrize("name", PAPER)
def test_candidates_of_the_paper(name: str) -> None:
    failing, expected = PAPER[name]
    assert chosen(scenes.ALL[name]().assembly, *failing) == expected
    assert chosen(scenes.ALL[name]().assembly) == ()


@given(st.integers(0, 10**6))
@settings(max_examples=30, deadline=None)
def test_what_is_chosen_is_closed_and_no_larger_than_it_must_be(seed: int) -> None:
    """Equations with a candidate hold candidates only; those of any other operation hold none; more failures, more."""
    scene = random_scene(seed)
    rng = np.random.default_rng(seed)
    n = len(scene.assembly)
    system = build_contact_equations(scene.assembly, scene.start, scene.nominal_poses)
    failing = rng.random(len(system.letters)) < 0.3
    free = candidates(scene.assembly, failing)
    assert free == tuple(sorted(set(free), reverse=True))
    assert set(system.among(system.contacts_with(free)).variables(n)) <= set(free)
    assert set(system.among(failing).variables(n)) <= set(free)
    fewer = candidates(scene.assembly, failing & (rng.random(len(failing)) < 0.5))
    assert set(fewer) <= set(free)
