"""Layouts: whatever a seed draws, every contact stays closed, starts stay put, and the same seed draws the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from apo_bench import Assembly, draw_layout, load_scenario
from apo_bench.assembly import Contact, Poses, compute_placements
from apo_bench.geometry import pose
from apo_bench.geometry.covering import compute_overlap
from apo_bench.geometry.penetration import measure_intrusion
from apo_bench.scenario.layout import place_layout
from apo_bench.scenario.scenario import Turn
from tests import scenes
from tests.shipped import BOXES

NAMES = BOXES
SCENARIOS = {name: load_scenario(name) for name in NAMES}
GENERATOR_SEEDS = range(200)


def gap_m(assembly: Assembly, contact: Contact, poses: Poses) -> float:
    """The largest distance of a corner of the upper face from the plane of the lower one."""
    face = assembly.face(contact.manipulated)
    on = assembly.face(contact.environment)
    corners = pose.apply(poses[contact.manipulated.part], face.outline)
    local = pose.apply(pose.inverse(poses[contact.environment.part]), corners)
    return float(np.abs(local @ on.plane[:3] + on.plane[3]).max())


def overlap_m2(assembly: Assembly, contact: Contact, poses: Poses) -> float:
    face = assembly.face(contact.manipulated)
    on = assembly.face(contact.environment)
    return compute_overlap(face, poses[contact.manipulated.part], on, poses[contact.environment.part]).area


EXAMPLES = {
    "bridge_cycle": scenes.bridge,
    "stick_on_castles": scenes.stick_on_castles,
    "stick_in_tower": scenes.stick_in_tower,
    "carried_bridge": scenes.subassembly_on_castles,
    "vanished_fixture": scenes.fixture,
    "pocket_table": scenes.pockets,
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_scenes_of_the_paper_are_those_of_the_paper(name: str):
    """Who moves, whom it carries, which faces meet and where: as written out by hand."""
    scenario = SCENARIOS[name]
    example = EXAMPLES[name]()
    assert [o.moves for o in scenario.assembly.operations] == [o.moves for o in example.assembly.operations]
    for mine, paper in zip(scenario.assembly.operations, example.assembly.operations, strict=True):
        assert set(mine.contacts) == set(paper.contacts)
    assert scenario.assembly.odls() == example.assembly.odls()
    assert scenario.nominal_poses == pytest.approx(example.nominal_poses, abs=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_whatever_is_drawn_contacts_stay_closed_and_parts_apart(name: str):
    scenario = SCENARIOS[name]
    assembly = scenario.assembly
    nominal = compute_placements(assembly, scenario.start, scenario.nominal_poses)
    for seed in GENERATOR_SEEDS:
        layout = draw_layout(scenario, np.random.default_rng([seed, 0]))
        stages = compute_placements(assembly, layout.start, layout.poses)
        for k, operation in enumerate(assembly.operations):
            for contact in operation.contacts:
                assert gap_m(assembly, contact, stages[k]) < 1e-9
                if seed < 40:
                    part = overlap_m2(assembly, contact, stages[k]) / overlap_m2(assembly, contact, nominal[k])
                    assert part >= 0.6
            for other in set(assembly.solids) - {operation.main} if seed < 40 else ():
                a = assembly.solids[operation.main]
                b = assembly.solids[other]
                assert measure_intrusion(a, stages[k][operation.main], b, stages[k][other]) < 1e-9


@pytest.mark.parametrize("name", NAMES)
def test_draws_fill_their_ranges_and_stay_inside(name: str):
    scenario = SCENARIOS[name]
    site = scenario.site
    layouts = [draw_layout(scenario, np.random.default_rng([seed, 0])) for seed in GENERATOR_SEEDS]
    first = np.array([layout.poses[0] @ pose.inverse(scenario.nominal_poses[0]) for layout in layouts])
    yaw = np.arctan2(first[:, 1, 0], first[:, 0, 0])
    drawn = [first[:, 0, 3] - site.center_m[0], first[:, 1, 3] - site.center_m[1], yaw - np.mean(site.yaw_rad)]
    half = [*site.spread_m, np.ptp(site.yaw_rad) / 2]
    for shift in scenario.shifts:
        moved = [pose.inverse(T @ scenario.nominal_poses[shift.operation]) for T in first]
        along = [(m @ layout.poses[shift.operation])[:3, 3] for m, layout in zip(moved, layouts, strict=True)]
        drawn.append(np.array(along) @ shift.axis - (shift.low_m + shift.high_m) / 2)
        half.append((shift.high_m - shift.low_m) / 2)
    for values, width in zip(drawn, half, strict=True):
        assert np.abs(values).max() <= width + 1e-12
        assert np.ptp(values) > 1.8 * width, "200 uniform draws come near both ends"
        assert abs(values.mean()) < 4 * width / np.sqrt(3 * len(values))
    assert np.abs(np.corrcoef(drawn) - np.eye(len(drawn))).max() < 0.3, "draws are independent"


@pytest.mark.parametrize("point", [(0.0, 0.0, 0.0), (-0.03, 0.01, 0.0)])
def test_a_turn_is_one_about_its_point_and_leaves_what_shifts_draw(point: tuple[float, float, float]):
    """The point stays where it is, the part turns by what was asked, and shifts of the same seed stay the same."""
    plain = SCENARIOS["stick_in_tower"]
    turn = Turn(0, np.array([0.0, 0.0, 1.0]), np.array(point), -0.2, 0.4)
    turned = replace(plain, turns=(turn,))
    for angle in (-0.2, 0.4):
        layout = place_layout(turned, 0.1, 0.0, 0.3, turns_rad=[angle])
        before = place_layout(plain, 0.1, 0.0, 0.3)
        moved = pose.inverse(before.poses[0]) @ layout.poses[0]
        np.testing.assert_allclose(pose.apply(moved, np.array([point])), [point], rtol=0, atol=1e-12)
        assert np.arctan2(moved[1, 0], moved[0, 0]) == pytest.approx(angle)
        assert (layout.poses[1:] == before.poses[1:]).all()
    found = []
    drawn = [draw_layout(s, np.random.default_rng([7, 0])) for s in (plain, turned)]
    assert (drawn[0].poses[1:] == drawn[1].poses[1:]).all()
    for seed in GENERATOR_SEEDS:
        each = [draw_layout(s, np.random.default_rng([seed, 0])).poses[0] for s in (plain, turned)]
        found.append(np.arctan2(*(pose.inverse(each[0]) @ each[1])[[1, 0], [0, 0]]))
    assert -0.2 <= min(found) < -0.17
    assert 0.37 < max(found) <= 0.4
