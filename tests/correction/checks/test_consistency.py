"""The test of a correction: quiet where everything is right, and naming the relation that is wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import kstest

from apo_bench import Assembly, ContactCorrector, Correction, Observation, correct, correct_many
from apo_bench.assembly import Consistency, Contact, PartFace
from apo_bench.geometry import Face
from tests import scenes

ALONG = {"redundant": ("R3", "stick.py on castle1.spy"), "not redundant": ("R1", "castle1.bottom on table.top")}
"""In Fig. 3 a side of the stick contradicts the other one; in the tower nothing contradicts the height of the table."""
SCENES = {"redundant": scenes.stick_on_castles, "not redundant": scenes.stick_in_tower}


def shifted(assembly: Assembly, by_mm: Mapping[str, float]) -> Assembly:
    """The same relations, with the lower face of some contacts, `a.py on b.spy`, off along its normal."""
    solids = dict(assembly.solids)
    operations = []
    for operation in assembly.operations:
        contacts = []
        for contact in operation.contacts:
            part, name = contact.environment
            if str(contact) in by_mm:
                old = solids[part].faces[name]
                new = Face(f"{name}_off", old.outline + 1e-3 * by_mm[str(contact)] * old.normal, fit=old.fit)
                solids[part] = replace(solids[part], faces={**solids[part].faces, new.name: new})
                contacts.append(Contact(contact.manipulated, PartFace(part, new.name)))
            else:
                contacts.append(contact)
        operations.append(replace(operation, contacts=tuple(contacts)))
    return replace(assembly, solids=solids, operations=tuple(operations))


def look(scene: scenes.Scene, seed: int, by_mm: Mapping[str, float] | None = None) -> Observation:
    """An observation at 1 mm and 1 degree, with some relations told wrongly."""
    seen = scenes.seen(scene, scenes.noisy(scene.nominal_poses, np.random.default_rng(seed), 1.0, 1.0))
    return replace(seen, assembly=shifted(scene.assembly, by_mm or {}))


def consistency_of(made: Correction) -> Consistency:
    assert made.test is not None
    return made.test


def p_values(scene: scenes.Scene, draws: int, times: float = 1.0) -> list[float]:
    """Of draws at 1 mm and 1 degree, whose noise is `times` what is stated."""
    looks = [
        scenes.seen(scene, scenes.noisy(scene.nominal_poses, np.random.default_rng(seed), 1.0, 1.0))
        for seed in range(draws)
    ]
    stated = [replace(seen, covariance=seen.covariance / times**2) for seen in looks]
    return [consistency_of(made).p_value for made in correct_many(stated, ContactCorrector("apply"))]


@pytest.mark.parametrize("name", ["stick_on_castles", "bridge"])
def test_p_values_are_uniform_where_everything_is_right(name: str) -> None:
    p = p_values(scenes.ALL[name](), 300)
    assert kstest(p, "uniform").pvalue > 0.01
    assert np.mean(np.array(p) < 0.01) <= 0.03


def off(contact: str) -> str:
    """What the shifted contact is called."""
    return contact.replace("spy", "spy_off").replace("top", "top_off")


@pytest.mark.parametrize("kind", ALONG)
def test_a_relation_that_is_wrong_by_far_is_named(kind: str) -> None:
    relation, contact = ALONG[kind]
    for seed in range(2):
        for by_mm in (10.0, -10.0):
            seen = look(SCENES[kind](), seed, {contact: by_mm})
            made = correct(seen, "contact")
            test = consistency_of(made)
            assert not test.passes
            assert relation in [suspect.relation for suspect in test.ambiguous]
            assert relation in made.sentence
            assert {suspect.relation for suspect in test.suspects} == {f"R{i + 1}" for i in range(4)}
            if kind == "redundant":
                assert test.suspects[0].relation == relation
                assert made.status == "inconsistent"
                assert made.covariance is None
            else:
                assert made.ok
            named = next(suspect for suspect in test.suspects if suspect.relation == relation)
            assert off(contact) in map(str, named.contacts)
            assert named.made == (2 if kind == "redundant" else 0)


@pytest.mark.parametrize("kind", ALONG)
def test_what_to_do_if_the_test_fails(kind: str) -> None:
    relation, contact = ALONG[kind]
    seen = look(SCENES[kind](), 2, {contact: 10.0})
    apply, warn, refuse, drop = (ContactCorrector(doubt)(seen) for doubt in ("apply", "warn", "refuse", "drop"))
    wrong = "inconsistent" if kind == "redundant" else "converged"
    assert (apply.status, warn.status) == (wrong, wrong)
    assert refuse.status == ("inconsistent" if kind == "redundant" else "doubtful")
    assert (drop.status, drop.dropped) == ("converged", (f"{relation}: {off(contact)}",))
    assert not consistency_of(apply).suspects
    assert "suspected" not in apply.sentence
    assert f"suspected: {relation}" in warn.sentence
    assert f"left out: {relation}" in drop.sentence
    assert drop.test_after is not None
    assert drop.test_after.passes
    assert apply.dropped == warn.dropped == refuse.dropped == ()
    assert_allclose(warn.poses, apply.poses, rtol=0, atol=0)
    assert not consistency_of(drop).passes
    assert drop.covariance is not None
    assert warn.covariance is None or kind == "not redundant"
