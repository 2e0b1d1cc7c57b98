"""How far faces of parts that fit may be apart: the play of all faces together, in every scenario."""

from __future__ import annotations

from collections.abc import Iterator
from math import radians, sin

import numpy as np
import pytest

from apo_bench import Scenario, load_scenario
from apo_bench.assembly import (
    Contact,
    ContactMeasurements,
    Poses,
    classify_contact,
    compute_joint_play_mm,
    compute_placements,
)
from apo_bench.geometry import measure_intrusion_depths, pose
from apo_bench.judging.contact_limits import ContactCase, ContactJudge
from apo_bench.planning.prediction.interference import make_physical_solids
from apo_bench.records import Thresholds
from tests.end_states import CASTLES, CLEARANCE_MM
from tests.shipped import TILTED

pytestmark = pytest.mark.numeric

Pair = tuple[list[Contact], int, Poses]
"""The contacts of two parts, the operation that makes them, and where all parts are then."""
WALKS = 4
STEPS = 5
HALVINGS = 14
"""Of up to some mm: a depth is met to within its limit of 1 um."""
FARTHEST_MM = 1.5
FARTHEST_DEG = 1.0
"""Motions at both ends of what is tried: farther than the play of anything here, less than what leaves a slot."""
WALLS_MM = 0.02
"""Holes are polygons around their circle, and depths are measured to 2 um."""


def pairs(scenario: Scenario) -> Iterator[Pair]:
    assembly = scenario.assembly
    history = compute_placements(assembly, scenario.start, scenario.nominal_poses)
    relations = assembly.relations()
    for arc in assembly.arcs():
        made = relations[arc[0]].made
        yield [relations[i].contact for i in arc], made, history[made]


def plays(name: str) -> dict[str, float]:
    scenario = load_scenario(name)
    found = {}
    for contacts, made, true in pairs(scenario):
        for contact in contacts:
            play = compute_joint_play_mm(scenario.assembly, contact, made, true, scenario.clearance_mm)
            if play is not None:
                found[str(contact)] = play
    return found


def test_the_play_between_the_walls_of_a_slot_is_the_clearance() -> None:
    """The stick between two parallel walls; its floor, with nothing above it, bounds nothing."""
    scene = CASTLES()
    true = compute_placements(scene.assembly, scene.start, scene.nominal_poses)[-1]
    found = [
        compute_joint_play_mm(scene.assembly, contact, 2, true, CLEARANCE_MM)
        for contact in scene.assembly.operations[2].contacts
    ]
    assert found == [None, CLEARANCE_MM, CLEARANCE_MM] * 2


def test_a_slide_sinks_in_its_dovetail_and_gets_room_between_the_walls() -> None:
    """By hand, walls leaning by 60 degrees: sunk by c the slide is c sin 30 off both walls, and may go on until the
    other one, receded by c, stops it: c + 2 c sin 30. Its floor opens until both walls stop it, c / sin 30; rolled as
    well, until an edge of the bottom is on the receded floor, by the factor that the geometry of the trapezium gives.
    """
    c = 0.25
    sine = sin(radians(30.0))
    a = 31.547005  # width of the bottom, and what a roll opens at the walls per radian, over sine [mm]
    b = 4.226497
    lifted = (c / sine + b / a * c) / (1.0 - b / a)
    found = plays("dovetail")
    assert len(found) == 6
    for base in ("base1", "base2"):
        assert found[f"slide.bottom on {base}.floor"] == pytest.approx(lifted, abs=1e-4)
        assert found[f"slide.lean_n on {base}.slot_n"] == pytest.approx(c + 2 * c * sine, abs=1e-5)
        assert found[f"slide.lean_p on {base}.slot_p"] == pytest.approx(c + 2 * c * sine, abs=1e-5)


def at_edge(scenario: Scenario, pair: Pair, start: Poses, motion: np.ndarray, limit_m: float) -> Poses | None:
    """The poses where a motion, taken so far, gets the parts as they are made that deep into each other.

    None if it never does.
    """
    contacts = pair[0]
    moved, rests = (end.part for end in contacts[0])
    solids = make_physical_solids(scenario.assembly, scenario.clearance_mm)

    def after(share: float) -> Poses:
        return {**start, moved: start[moved] @ pose.exp(share * motion)}

    def depth(share: float) -> float:
        T = after(share)[moved]
        a = solids[moved].pieces
        b = solids[rests].pieces
        return float(measure_intrusion_depths(a, T[:3, :3], T[None, :3, 3], b, start[rests])[0])

    if depth(1.0) <= limit_m:
        return None
    low = 0.0
    high = 1.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if depth(middle) <= limit_m else (low, middle)
    return after(low)


def touching(scenario: Scenario, pair: Pair, poses: Poses) -> dict[Contact, bool]:
    contacts, made, true = pair
    judge = ContactJudge(ContactMeasurements(scenario.assembly), Thresholds(), scenario.clearance_mm)
    verdicts = judge.verdicts([ContactCase(c, made, "made", poses, true) for c in contacts])
    return {verdict.contact: verdict.touching for verdict in verdicts}


def bounded(scenario: Scenario, pair: Pair) -> list[Contact]:
    """Contacts that the play of a pair keeps from opening ever wider."""
    contacts, made, true = pair
    assembly = scenario.assembly
    return [
        c
        for c in contacts
        if classify_contact(*map(assembly.face_of, c)) == "shaft in hole"
        or compute_joint_play_mm(assembly, c, made, true, scenario.clearance_mm) is not None
    ]


def near(pair: Pair, poses: Poses) -> bool:
    """Whether the parts are still about where they belong: what nothing bounds may go anywhere."""
    moved, rests = (end.part for end in pair[0][0])
    then, now = (pose.inverse(at[rests]) @ at[moved] for at in (pair[2], poses))
    return bool(np.abs(pose.log(pose.inverse(then) @ now)[:3]).max() < 1e-3 * FARTHEST_MM)


@pytest.mark.parametrize("name", ["carried_bridge", *TILTED, "peg_in_hole"])
def test_all_play_is_right_and_what_is_deeper_is_not(name: str) -> None:
    """Parts as they are made, moved anyhow until they touch, and on from there: their contacts hold. Moved until they
    are deeper in each other than the margin: one does not."""
    rng = np.random.default_rng(5)
    scenario = load_scenario(name)
    margin_m = 1e-3 * Thresholds().fit_margin_mm
    tried = 0
    for pair in pairs(scenario):
        held = bounded(scenario, pair)
        if not held:
            continue
        for _ in range(WALKS if name != "peg_in_hole" else 1):
            here = pair[2]
            for _ in range(STEPS):
                way = rng.normal(size=6) * np.repeat([1e-3 * FARTHEST_MM, radians(FARTHEST_DEG)], 3)
                beyond = at_edge(scenario, pair, here, way, margin_m + 1e-3 * WALLS_MM)
                assert beyond is None or not all(touching(scenario, pair, beyond).values()), (pair[0], way)
                edge = at_edge(scenario, pair, here, way, 1e-6)
                if edge is not None and near(pair, edge):
                    here = edge
                    holds = touching(scenario, pair, here)
                    assert all(holds[c] for c in held), (pair[0], way)
                    tried += 1
    assert tried > 0 or not any(bounded(scenario, pair) for pair in pairs(scenario))
