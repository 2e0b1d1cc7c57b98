"""Contacts and poses decided together: how sets are scored, what physics forbids, and what the whole finds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from apo_bench import Assembly, ContactCorrector, Observation
from apo_bench.assembly import Contact, Operation, PartFace, build_contact_equations
from apo_bench.geometry import Hull, find_escapes, pose
from apo_bench.geometry.penetration import measure_intrusion
from apo_bench.perception.detection.joint_detection import detect_contacts_jointly
from apo_bench.perception.detection.pose_estimate import estimate_poses
from tests import scenes
from tests.perception.detection.test_contacts import NAMES, contacts, seen_at, stated


def on(text: str) -> Contact:
    """`A.nz on table.top`."""
    m, e = (PartFace(*face.split(".")) for face in text.split(" on "))
    return Contact(m, e)


def block_at(x: float, y: float, z: float, noise_level: float = 1.0) -> Observation:
    """One block seen here, in mm."""
    scene = scenes.scene([scenes.table(), scenes.block("A")], [Operation("A")], [scenes.mm(x, y, z)])
    return stated(scenes.seen(scene, scene.nominal_poses), noise_level)


def beside(apart_mm: float, noise_level: float) -> Observation:
    """Two blocks on the table, one this far beside the other."""
    solids = [scenes.table(), scenes.block("A"), scenes.block("B")]
    goals = [scenes.mm(0, 0, 25), scenes.mm(50 + apart_mm, 0, 25)]
    scene = scenes.scene(solids, [Operation("A"), Operation("B")], goals)
    return stated(scenes.seen(scene, goals), noise_level)


def names(assembly: Assembly) -> set[str]:
    return {str(relation.contact) for relation in assembly.relations()}


def test_an_estimate_lies_where_contact_puts_it() -> None:
    """`contact` solves exactly; here contacts give a little, 0.1 mm."""
    for name in NAMES:
        scene = scenes.ALL[name]()
        seen = seen_at(scene, 1, 1.0)
        estimated = estimate_poses(seen, scene.assembly, seen.poses)
        corrected = ContactCorrector()(seen)
        assert (
            np.abs(build_contact_equations(scene.assembly, seen.start, estimated.poses).residual(estimated.poses)).max()
            < 5e-4
        )
        assert_allclose(estimated.poses, corrected.poses, atol=2e-2)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("noise_level", [0.5, 2.0])
def test_every_contact_is_recognised_and_no_other(name: str, noise_level: float) -> None:
    scene = scenes.ALL[name]()
    recognised = detect_contacts_jointly(seen_at(scene, 0, noise_level))
    assert contacts(recognised.assembly) == contacts(scene.assembly)
    assert tuple(e.contact for e in recognised.evidence) == tuple(r.contact for r in recognised.assembly.relations())
    assert recognised.probability is not None
    assert recognised.probability > 0.5


def test_near_faces_touch_if_the_noise_explains_the_gap() -> None:
    assert names(detect_contacts_jointly(beside(1.0, 1.0)).assembly) >= {"B.nx on A.px"}
    assert "B.nx on A.px" not in names(detect_contacts_jointly(beside(8.0, 1.0)).assembly)
    assert "B.nx on A.px" not in names(detect_contacts_jointly(beside(1.0, 0.1)).assembly)


def test_probabilities_say_what_is_not_certain() -> None:
    sure = detect_contacts_jointly(beside(30.0, 1.0))
    unsure = detect_contacts_jointly(beside(4.0, 1.5))
    assert sure.probability is not None
    assert sure.probability > 0.99
    assert unsure.probability is not None
    assert unsure.rival is not None
    assert unsure.probability < 0.97
    assert names(unsure.rival.assembly) ^ names(unsure.assembly) == {"B.nx on A.px"}
    assert unsure.probability + unsure.rival.probability <= 1.0 + 1e-12


def test_what_is_let_go_of_lies_on_something_however_far_it_was_seen_above() -> None:
    """3.7 deviations above the table is little beside hanging in the air."""
    assert names(detect_contacts_jointly(block_at(0, 0, 25 + 15, noise_level=4.0)).assembly) == {"A.nz on table.top"}


def test_parts_that_are_seen_inside_each_other_touch() -> None:
    """5.3 mm apart may be a gap, 5.3 mm inside each other cannot be: touching is likelier there."""
    apart = detect_contacts_jointly(beside(5.3, 1.0))
    within = detect_contacts_jointly(beside(-5.3, 1.0))
    assert "B.nx on A.px" not in names(apart.assembly)
    assert "B.nx on A.px" in names(within.assembly)


@pytest.mark.parametrize("hulls", [False, True])
def test_ways_out_are_as_deep_as_the_intrusion_and_lead_out(hulls: bool) -> None:
    a = scenes.block("A")
    b = scenes.block("B")
    if hulls:
        a = replace(a, pieces=tuple(Hull(piece.name, piece.corners) for piece in a.pieces))
    T_a = scenes.mm(45, 3, 26)
    T_b = scenes.mm(0, 0, 25) @ pose.exp(np.array([0, 0, 0, 0.1, 0.2, 0.3]))
    (way,) = find_escapes(a, T_a, b, T_b, 1e-4)
    best = int(way.lengths.argmin())
    assert way.lengths[best] == pytest.approx(measure_intrusion(a, T_a, b, T_b))
    for direction, length in zip(way.directions, way.lengths, strict=True):
        out = np.array(T_a)
        out[:3, 3] += (length + 1e-5) * direction
        assert measure_intrusion(a, out, b, T_b) == 0.0
