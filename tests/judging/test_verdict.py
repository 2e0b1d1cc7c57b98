"""An audit of the judge: constructed end states, each with the verdict that a person would give."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from apo_bench import Criteria, judge
from apo_bench.assembly import ReachedState, compute_placements
from apo_bench.geometry import pose
from apo_bench.judging.finished_assembly import list_fixtures
from apo_bench.records import Thresholds
from tests import rounds, scenes
from tests.end_states import (
    CASTLES,
    CLEARANCE_MM,
    END,
    FIXTURE,
    LAYOUT,
    TOWER,
    Edit,
    never,
    put,
    shift,
    shown,
    snapshot,
    state,
    verdict,
)

pytestmark = pytest.mark.numeric


class Case(NamedTuple):
    """A state, and what is first wrong with it."""

    what: str
    """What a person sees."""
    scene: Callable[[], scenes.Scene]
    edits: list[Edit]
    code: str = "ok"


RIGHT = [
    Case("tower, exactly", TOWER, []),
    Case("fixture, exactly, the fixture is away at the end", FIXTURE, []),
    Case("tower, the stick lies skew between its walls", TOWER, [shift("stick", 3, 0, 0, 0, (0, 0, 0.4))]),
    Case("tower, castle 2 overhangs by 29 of 60 mm", TOWER, [shift("castle2", 2, 29, 0, 0)]),
    Case("tower, castle 2 is 0.3 mm aside", TOWER, [shift("castle2", 2, 0, 0.3, 0)]),
    Case("tower, geoms 0.04 mm deep", TOWER, [state(END, penetration_m=0.04e-3)]),
    Case("tower, pushed by 0.9 mm at the insertion", TOWER, [shift(p, 3, 0.9, 0, 0) for p in ("castle1", "castle2")]),
    Case(
        "everything stands a little elsewhere on the table",
        CASTLES,
        [
            put("castle1", 1, scenes.mm(-70, 12, 0)),
            put("castle2", 2, scenes.mm(70, 12, 0)),
            put("stick", 3, scenes.mm(0, 12, 40)),
        ],
    ),
    Case("tower, creeping at 0.5 mm/s", TOWER, [state(END, speed_m_s=0.5e-3)]),
]
"""A person would say: done."""

NEARLY = [
    Case("tower, the stick is 0.45 mm inside a wall", TOWER, [shift("stick", 3, 0, 0.45, 0)], "gap"),
    Case("tower, castle 2 floats by 0.15 mm", TOWER, [shift("castle2", 2, 0, 0, -0.15)], "gap"),
    Case(
        "fixture, castle 2 stands 1 mm off the fixture",
        FIXTURE,
        [shift("castle2", 3, 0, -1, 0), shift("castle2", 5, 0, 1, 0)],
        "gap",
    ),
    Case("tower, geoms 0.06 mm deep", TOWER, [state(END, penetration_m=0.06e-3)], "penetration"),
    Case("tower, deep geoms on the way, not at the end", TOWER, [state(2, penetration_m=1e-3)], "penetration"),
    Case(
        "tower, pushed by 1.1 mm at the insertion",
        TOWER,
        [shift(p, 3, 1.1, 0, 0) for p in ("castle1", "castle2")],
        "pushed",
    ),
    Case(
        "tower, pushed 1.1 mm by the next part, pushed back by the last",
        TOWER,
        [shift("castle1", 2, 1.1, 0, 0, until=3)],
        "pushed",
    ),
    Case("tower, the stick is still held", TOWER, [state(END, released=False)], "not_released"),
    Case("tower, castle 2 was still held when it was over", TOWER, [state(2, released=False)], "not_released"),
    Case("tower, sliding at 2 mm/s", TOWER, [state(END, speed_m_s=2e-3)], "not_at_rest"),
    Case("tower, turning at 3 degrees/s", TOWER, [state(END, spin_rad_s=np.radians(3.0))], "not_at_rest"),
    Case("tower, a depth that is not a number", TOWER, [state(END, penetration_m=np.nan)], "penetration"),
]
"""A person would say: almost; each contact is there within millimetres."""

WRONG = [
    Case(
        "everything is assembled well, but at the other end of the table",
        CASTLES,
        [
            put("castle1", 1, scenes.mm(-70, 90, 0)),
            put("castle2", 2, scenes.mm(70, 90, 0)),
            put("stick", 3, scenes.mm(0, 90, 40)),
        ],
        "overlap",
    ),
    Case("tower, castle 2 is 6 mm aside", TOWER, [shift("castle2", 2, 0, 6, 0)], "gap"),
    Case("tower, castle 2 was not turned over", TOWER, [put("castle2", 2, scenes.mm(0, 0, 40))], "gap"),
    Case("tower, castle 2 overhangs by 31 of 60 mm", TOWER, [shift("castle2", 2, 31, 0, 0)], "overlap"),
    Case(
        "castles, the stick turned end for end: other faces touch",
        CASTLES,
        [shift("stick", 3, 0, 0, 0, (0, 0, 180))],
        "gap",
    ),
    Case("tower, the stick was never inserted", TOWER, [never(3, END)], "not_made"),
    Case("tower, nothing was done", TOWER, [never(1, 2, 3, END)], "not_made"),
]
"""A person would say: no."""


FLIPPED = {
    "fixture, castle 2 stands 1 mm off the fixture": "the fixture is put away, and it shows nowhere",
    "tower, deep geoms on the way, not at the end": "it was on the way",
    "tower, pushed 1.1 mm by the next part, pushed back by the last": "all ends where it was put",
    "tower, castle 2 was still held when it was over": "it was on the way",
    "everything is assembled well, but at the other end of the table": "it is right in itself",
    "tower, pushed by 1.1 mm at the insertion": "all of it moved as one, and may stand anywhere on the table",
    "castles, the stick turned end for end: other faces touch": "it is the same stick, turned by half a turn",
}
"""States that are a success and not as demonstrated, each with what a person says who sees the finished assembly."""


@pytest.mark.parametrize(
    ("cases", "right", "nearly"), [(RIGHT, True, True), (NEARLY, False, True), (WRONG, False, False)]
)
def test_what_is_right_or_nearly_or_wrong(cases: list[Case], right: bool, nearly: bool) -> None:
    """As it was demonstrated, and to a person who sees the finished assembly."""
    for case in cases:
        found = verdict(case.scene(), case.edits)
        made = found.demonstrated
        assert (found.as_demonstrated, made.loose, made.code) == (right, nearly, case.code), case.what
        assembled = right or case.what in FLIPPED
        assert (found.success, found.finished.code == "ok") == (assembled, assembled), case.what
        assert found.loose_success or not assembled


def test_each_contact_is_judged_when_made_and_at_the_end_if_it_stands() -> None:
    moments = {
        (str(c.contact), c.operation + 1, c.moment)
        for c in shown(FIXTURE(), []).contacts
        if "cube" in str(c.contact) or c.contact.manipulated.face == "bottom"
    }
    assert moments == {
        ("castle1.bottom on table.top", 1, "made"),
        ("castle1.bottom on table.top", 1, "end"),
        ("cube.nz on table.top", 2, "made"),
        ("castle2.bottom on table.top", 3, "made"),
        ("castle2.bottom on table.top", 3, "end"),
        ("castle2.py on cube.ny", 3, "made"),
        ("cube.nz on table.top", 4, "made"),
        ("cube.nz on table.top", 4, "end"),
    }


def test_poses_that_are_not_finite_fail_without_a_crash() -> None:
    scene = scenes.turned(TOWER(), LAYOUT)
    poses = compute_placements(scene.assembly, scene.start, scene.nominal_poses)
    good = [snapshot(dict(state)) for state in poses]
    broken = snapshot(dict(poses[-1]))
    object.__setattr__(broken, "poses", {**poses[-1], "stick": np.full((4, 4), np.nan)})
    for reached in (ReachedState((*good[:2], broken), broken), ReachedState(tuple(good), broken)):
        found = judge(scene.assembly, reached, scene.nominal_poses, Criteria(Thresholds(), CLEARANCE_MM))
        assert (found.success, found.as_demonstrated, found.loose_success) == (False, False, False)
        assert found.finished.code == found.demonstrated.code == "not_made"


SCALES = st.sampled_from([0.02, 0.2, 1.0, 5.0, 20.0])
THRESHOLDS = st.builds(
    Thresholds,
    fit_margin_mm=st.floats(0.0, 50.0),
    support_mm=st.floats(0.0, 50.0),
    overlap_fraction=st.floats(0.0, 1.0),
    placed_part_shift_mm=st.floats(0.0, 50.0),
    loose_gap_mm=st.floats(0.0, 10.0),
    loose_angle_deg=st.floats(0.0, 90.0),
)


@given(st.sampled_from([TOWER, CASTLES]), st.integers(0, 10**6), SCALES, THRESHOLDS)
@settings(max_examples=15, deadline=None)
def test_strict_implies_loose_whatever_the_thresholds(build, seed: int, scale: float, thresholds: Thresholds) -> None:
    rng = np.random.default_rng(seed)
    edits = [
        shift(part, k, *(rng.standard_normal(3) * scale), rng.standard_normal(3) * scale)
        for k, part in enumerate(("castle1", "castle2", "stick"), start=1)
    ]
    for limits in (thresholds, Thresholds()):
        whole = verdict(build(), edits, limits)
        assert whole.loose_success or not whole.success
        assert whole.success or not whole.as_demonstrated
        for found in (whole.finished, whole.demonstrated):
            assert all(c.loose or not c.strict for c in found.contacts)
            assert found.holds == (found.code == "ok") == (not any(found.conditions.values()))


@given(st.integers(0, 10**6))
@settings(max_examples=5, deadline=None)
def test_the_world_frame_does_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scene = TOWER()
    goals = scenes.noisy(scene.nominal_poses, rng, 0.3, 0.3)
    numbers = []
    for W in (np.eye(4), pose.exp(rng.standard_normal(6))):
        there = scenes.turned(scene, W)
        states = [snapshot(dict(p)) for p in compute_placements(there.assembly, there.start, W @ goals)]
        both = judge(
            there.assembly,
            ReachedState(tuple(states), states[-1]),
            there.nominal_poses,
            Criteria(Thresholds(), CLEARANCE_MM),
        )
        found = (both.demonstrated, both.finished)
        numbers.append([x for f in found for x in (f.gap_mm, f.angle_deg, f.overlap, f.placed_part_shift_mm)])
    assert numbers[0] == pytest.approx(numbers[1], abs=1e-6)


def test_parts_that_touch_are_told_apart_by_what_their_contacts_leave_free() -> None:
    """A castle pushed along its slot slides on the other one; pushed aside by as much it would open a contact."""
    along = verdict(TOWER(), [shift("castle2", END, 1.2, 0, 0)])
    assert (along.finished.code, along.finished.why) == (
        "pushed",
        "castle2 against castle1 by 1.20 mm, where 1 mm are allowed",
    )
    both = verdict(TOWER(), [shift("castle1", END, -0.6, 0, 0), shift("castle2", END, 0.6, 0, 0)])
    assert both.success
    long = verdict(TOWER(), [shift("castle1", END, 1.2, 0, 0), shift("castle2", END, 1.2, 0, 0)])
    assert (long.finished.code, long.finished.why[:21]) == ("pushed", "stick against castle1")


@pytest.mark.parametrize(
    ("build", "off_mm", "why"),
    [
        (rounds.peg_in_plate, (1, 0, 0), "peg.wall on plate.bore is 1.00 mm off the axis, where 0.35 mm are allowed"),
        (rounds.countersink, (0, 0, 1), "plug.cone on plate.sink is 0.71 mm off its seat, where 0.1 mm are allowed"),
        (rounds.on_rim, (0, 0, 1), "plug.cone on plate.rim is 0.71 mm off its seat, where 0.1 mm are allowed"),
    ],
)
def test_a_gap_is_across_the_faces_and_named_after_them(
    build: Callable[[], scenes.Scene], off_mm: tuple[float, ...], why: str
) -> None:
    """Cones of 45 degrees that are 1 mm apart along their axis are 1 mm / sqrt(2) apart."""
    part = build().assembly.operations[-1].main
    assert verdict(build(), [shift(part, 2, *off_mm)]).finished.why == why


def test_where_a_fixture_ends_is_free_and_what_it_does_there_is_not() -> None:
    assert list_fixtures(FIXTURE().assembly) == {"cube"}
    far = [put("cube", 4, scenes.mm(200, -160, 40, (0, 90, 0))), shift("cube", END, 30, 0, 0)]
    assert verdict(FIXTURE(), far).success
    for fields in ({"speed_m_s": 0.01}, {"released": False}, {"penetration_m": 1e-3}):
        assert not verdict(FIXTURE(), [*far, state(END, **fields)]).success


def test_a_scenario_can_ask_for_what_was_demonstrated() -> None:
    scene = FIXTURE()
    poses = compute_placements(scene.assembly, scene.start, scene.nominal_poses)
    off = [dict(state) for state in poses]
    off[2]["castle2"] = off[2]["castle2"] @ scenes.mm(0, -0.9, 0)
    reached = ReachedState(tuple(map(snapshot, off)), snapshot(dict(poses[-1])))
    for meaning, right in (("assembled", True), ("as_demonstrated", False)):
        found = judge(scene.assembly, reached, scene.nominal_poses, Criteria(Thresholds(), CLEARANCE_MM, meaning))
        assert (found.success, found.as_demonstrated) == (right, False)
        assert found.rests_on.code == ("ok" if right else "gap")
