"""Wrong relations: exactly one thing is wrong, nothing but a corrector is told, and it is told nothing of the rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from apo_bench import Assembly, InputError, load_scenario
from apo_bench.assembly import Contact, build_contact_equations, build_relation_graph
from apo_bench.perception.observation.wrong_contacts import (
    NEAR_FACES_M,
    TOUCHING_M,
    FaceOffset,
    add_contact,
    find_wrong_relation,
    make_contacts,
    omit_contact,
    replace_contacts,
)
from apo_bench.trial.trial_stages import CONTACT_SOURCE, stream
from tests import scenes

SEEDS = range(4)


def contacts(assembly: Assembly) -> set[tuple[int, Contact]]:
    return {(relation.made, relation.contact) for relation in assembly.relations()}


def gaps(assembly: Assembly, scene: scenes.Scene) -> np.ndarray:
    """The largest |e| of each contact at the truth, [m]."""
    return build_contact_equations(assembly, scene.start, scene.nominal_poses).gaps(scene.nominal_poses)


@pytest.mark.parametrize("name", ["stick_in_tower", "pockets"])
@pytest.mark.parametrize("seed", SEEDS)
def test_exactly_one_contact_is_wrong(name: str, seed: int) -> None:
    scene = scenes.ALL[name]()
    right = contacts(scene.assembly)
    arguments = (scene.assembly, scene.start, scene.nominal_poses)
    less = contacts(omit_contact(*arguments, stream(seed, CONTACT_SOURCE)))
    assert less < right
    assert len(right - less) == 1
    off = contacts(FaceOffset()(*arguments, stream(seed, CONTACT_SOURCE)))
    assert len(off) == len(right)
    assert len(right - off) == 1
    more = contacts(add_contact(*arguments, stream(seed, CONTACT_SOURCE)))
    assert more > right
    assert len(more - right) == 1


@pytest.mark.parametrize("name", ["stick_in_tower", "pockets"])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_shifted_face_is_off_by_its_size_and_every_other_contact_holds(name: str, seed: int) -> None:
    scene = scenes.ALL[name]()
    wrong = FaceOffset(3e-3)(scene.assembly, scene.start, scene.nominal_poses, stream(seed, CONTACT_SOURCE))
    off = gaps(wrong, scene)
    accused = [r.contact not in scene.assembly.operations[r.made].contacts for r in wrong.relations()]
    assert_allclose(off[accused], 3e-3, atol=1e-12)
    assert off[~np.array(accused)].max(initial=0.0) < 1e-12


@pytest.mark.parametrize("name", ["block_on_block", "carried_bridge", "pocket_table"])
def test_a_false_contact_is_plausible(name: str) -> None:
    """It joins a moved part and one that stands there; their faces are apart, and where a scenario has them, near."""
    s = load_scenario(name)
    for seed in SEEDS:
        wrong = add_contact(s.assembly, s.start, s.nominal_poses, stream(seed, CONTACT_SOURCE))
        ((made, contact),) = contacts(wrong) - contacts(s.assembly)
        before = {part for operation in s.assembly.operations[:made] for part in operation.moves}
        assert contact.manipulated.part in s.assembly.operations[made].moves
        assert contact.environment.part in s.assembly.fixed | before
        system = build_contact_equations(wrong, s.start, s.nominal_poses)
        apart = system.gaps(s.nominal_poses)[[r.contact == contact and r.made == made for r in wrong.relations()]]
        assert apart > TOUCHING_M
        if name in ("carried_bridge", "pocket_table"):
            assert apart < NEAR_FACES_M


def test_the_culprit_is_the_relation_of_the_graph_that_is_told() -> None:
    scene = scenes.stick_in_tower()
    arguments = (scene.assembly, scene.start, scene.nominal_poses)
    for seed in SEEDS:
        assert find_wrong_relation(scene.assembly, omit_contact(*arguments, stream(seed, CONTACT_SOURCE))) is None
        for wrong in (
            add_contact(*arguments, stream(seed, CONTACT_SOURCE)),
            FaceOffset()(*arguments, stream(seed, CONTACT_SOURCE)),
        ):
            ((made, contact),) = contacts(wrong) - contacts(scene.assembly)
            (arc,) = [arc for arc in build_relation_graph(wrong).arcs if arc.made == made and contact in arc.contacts]
            assert find_wrong_relation(scene.assembly, wrong) == arc.name
    assert find_wrong_relation(scene.assembly, scene.assembly) is None


def test_relations_come_by_name_as_a_function_or_with_a_size() -> None:
    assert make_contacts("given") is None
    assert make_contacts("false-negative") is omit_contact
    assert make_contacts("apo_bench.perception.observation.wrong_contacts:add_contact") is add_contact
    assert make_contacts("face-offset:3mm") == FaceOffset(3e-3)
    assert make_contacts(FaceOffset(1e-3)) == FaceOffset(1e-3)


def test_relations_change_nothing_but_contacts_and_faces() -> None:
    scene = scenes.stick_in_tower()
    seen = scenes.seen(scene, scene.nominal_poses)
    for returned, words in (
        (None, "returned NoneType; return an Assembly"),
        (scene.assembly.first(2), "changed parts or operations"),
        (replace(scene.assembly, solids={"table": scenes.table()}), "changed parts or operations"),
    ):
        with pytest.raises(InputError) as refused:
            replace_contacts(seen, lambda *_, r=returned: r, scene.nominal_poses, np.random.default_rng(0))
        assert words in str(refused.value)
