"""Wrong relations of round faces."""

from __future__ import annotations

import numpy as np
import pytest

from apo_bench import Assembly
from apo_bench.assembly import Contact
from apo_bench.perception.observation.wrong_contacts import FaceOffset, add_contact, find_wrong_relation, omit_contact
from tests import rounds
from tests.brackets import on_pins

SCENES = {**rounds.ALL, "on_pins": on_pins}


def contacts(assembly: Assembly) -> set[tuple[int, Contact]]:
    return {(relation.made, relation.contact) for relation in assembly.relations()}


@pytest.mark.parametrize("name", ["nested", "in_groove", "on_pins"])
def test_exactly_one_contact_is_wrong(name: str) -> None:
    scene = SCENES[name]()
    right = contacts(scene.assembly)
    arguments = (scene.assembly, scene.start, scene.nominal_poses)
    for seed in range(4):
        assert len(right - contacts(omit_contact(*arguments, np.random.default_rng(seed)))) == 1
        off = contacts(FaceOffset()(*arguments, np.random.default_rng(seed)))
        assert (len(off), len(right - off)) == (len(right), 1)
        more = contacts(add_contact(*arguments, np.random.default_rng(seed)))
        assert more >= right
        assert len(more - right) <= 1


def test_a_round_face_is_off_across_its_axis() -> None:
    scene = rounds.through()
    seen = set[str]()
    for seed in range(12):
        wrong = FaceOffset(2e-3)(scene.assembly, scene.start, scene.nominal_poses, np.random.default_rng(seed))
        ((_, contact),) = contacts(wrong) - contacts(scene.assembly)
        part, face = contact.environment
        seen.add(face)
        if face == "bore_shifted":
            new = wrong.solids[part].rounds[face]
            old = wrong.solids[part].rounds["bore"]
            by = new.point - old.point
            assert np.linalg.norm(by) == pytest.approx(2e-3)
            assert by @ old.axis == pytest.approx(0.0, abs=1e-12)
            assert (new.radii, new.span, find_wrong_relation(scene.assembly, wrong)) == (
                old.radii,
                old.span,
                f"R{3 + (part == 'b')}",
            )
    assert seen == {"bore_shifted", "top_shifted"}
