"""Whether the numbers of a scenario fit its topology: contacts closed, parts apart, wherever the truth may vary to."""

from collections.abc import Iterator, Mapping
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import (
    Assembly,
    Contact,
    ContactKind,
    Layout,
    Poses,
    contact_kind,
    geometric_play,
    height,
    placements,
    play_mm,
)
from apo_bench.errors import InputError
from apo_bench.geometry import Face, angle_between, intrusion, mate, overlap, pose
from apo_bench.scenario.layout import layout_at
from apo_bench.scenario.order import check_order, in_the_air
from apo_bench.scenario.scenario import Scenario

_GAP_M = 1e-6
"""Faces that are said to touch are nearer than this."""
_ANGLE_DEG = 0.01
"""Normals of faces that are said to touch are opposite within this, and axes parallel."""
_NO_PLAY_MM = 1e-6
"""A shaft with less play is as thick as its hole."""
_ALONG = "vary along an axis that no contact fixes"
DEEP_M = 2e-5
"""Parts that are deeper in each other do not only touch: pieces of an import may be so deep."""


_APART: Mapping[ContactKind | None, str] = {
    "shaft on plane": "the wall of the shaft is {:.4g} mm from the plane",
    "shaft in hole": "the axes are {:.4g} mm apart",
}
"""How faces fail to meet."""
_Pair = tuple[str, str, bytes]
"""Two parts, and where the second one is to the first."""


class _Case(NamedTuple):
    """A layout that the scenario can draw."""

    layout: Layout
    key: str = ""
    """The key to blame for what is wrong only here."""
    words: str = ""
    """Where it is, to follow a sentence."""
    site_only: bool = False
    """Only the site differs from the nominal layout: what moves as one needs no second look."""


def check_scenario(scenario: Scenario, file: str) -> None:
    """Check the nominal layout, both ends of every `vary`, and the corners of the site.

    Raises:
        InputError: The first thing found wrong.
    """
    _check_play(scenario, file)
    apart: set[_Pair] = set()
    for case in _cases(scenario):
        stages = (case.layout.start, *placements(scenario.assembly, case.layout.start, case.layout.goals))
        if not case.key:
            check_order(scenario.assembly, stages, file)
        _check_starts(scenario, file, case)
        _check_turns(scenario, file, case, stages)
        _check_contacts(scenario, file, case, stages)
        _check_intrusions(scenario, file, case, stages, apart)


def _cases(scenario: Scenario) -> Iterator[_Case]:
    site = scenario.site
    x, y = site.center_m
    middle = sum(site.yaw_rad) / 2
    yield _Case(layout_at(scenario, x, y, middle))
    for i, shift in enumerate(scenario.shifts):
        for length in (shift.low_m, shift.high_m):
            shifts = [length if j == i else 0.0 for j in range(len(scenario.shifts))]
            words = f" when it is varied by {1e3 * length:g} mm"
            yield _Case(layout_at(scenario, x, y, middle, shifts), f"operation {shift.operation + 1}, vary", words)
    for i, turn in enumerate(scenario.turns):
        for angle in (turn.low_rad, turn.high_rad):
            turns = [angle if j == i else 0.0 for j in range(len(scenario.turns))]
            words = f" when it is turned by {np.degrees(angle):g} degrees"
            yield _Case(
                layout_at(scenario, x, y, middle, turns_rad=turns), f"operation {turn.operation + 1}, vary", words
            )
    for i, j, yaw in product((-1, 1), (-1, 1), sorted({middle, *site.yaw_rad})):
        x = site.center_m[0] + i * site.spread_m[0]
        y = site.center_m[1] + j * site.spread_m[1]
        words = f" when the site is at ({1e3 * x:g}, {1e3 * y:g}) mm, turned by {np.degrees(yaw):g} degrees"
        yield _Case(layout_at(scenario, x, y, yaw), "site", words, site_only=True)


def _refuse(file: str, case: _Case, key: str, sentence: str, remedy: str) -> InputError:
    return InputError(f"{file}, {case.key or key}: {sentence}{case.words}; {remedy}.")


def _check_starts(scenario: Scenario, file: str, case: _Case) -> None:
    """Every movable part starts on something."""
    airborne = in_the_air(scenario.assembly, case.layout.start)
    if airborne is not None:
        part, sentence = airborne
        raise _refuse(file, case, f"parts, {part}, start, at_mm", sentence, "let it start on a part, such as the table")


def _check_turns(scenario: Scenario, file: str, case: _Case, stages: tuple[Poses, ...]) -> None:
    """A part turns about the vertical only: the robot does not turn parts over."""
    for k, operation in enumerate(scenario.assembly.operations):
        before = stages[k][operation.main]
        tilt = float(np.degrees(angle_between(before[2, :3], stages[k + 1][operation.main][2, :3])))
        if tilt > _ANGLE_DEG:
            raise _refuse(
                file,
                case,
                f"operation {k + 1}, goal, turn_deg",
                f"'{operation.main}' would have to be tilted by {tilt:.3g} degrees, only turns about the vertical are "
                "possible",
                "let it start tilted as it will lie",
            )


def _check_contacts(scenario: Scenario, file: str, case: _Case, stages: tuple[Poses, ...]) -> None:
    for k, operation in enumerate(scenario.assembly.operations):
        for number, contact in enumerate(operation.contacts, start=1):
            # When only the site moves, a contact is another one if the face below stays where it is.
            if not case.site_only or contact.environment.part in scenario.assembly.fixed - scenario.follows_site:
                key = f"operation {k + 1}, contacts, contact {number}"
                _check_contact(scenario, file, case, key, contact, stages[k + 1])


def _check_contact(scenario: Scenario, file: str, case: _Case, key: str, contact: Contact, poses: Poses) -> None:
    """Faces look at each other, meet, and cover some of each other."""
    a, b = map(scenario.assembly.face_of, contact)
    T_a, T_b = (poses[of.part] for of in contact)
    kind = contact_kind(a, b)
    if isinstance(a, Face) and isinstance(b, Face):
        angle = float(np.degrees(angle_between(T_a[:3, :3] @ a.normal, -T_b[:3, :3] @ b.normal)))
        above = height(a, T_a, b, T_b)
        apart = abs(above)
        tilted = f"the faces look {180 - angle:.4g} degrees apart"
        straighten = "180 are needed: turn the part, or name faces that look at each other"
        off = f"the faces are {1e3 * apart:.4g} mm {'apart' if above > 0 else 'too deep'}"
        meet = "move a goal until they meet exactly"
        beside = "the faces lie in one plane but do not overlap"
        common = overlap(a, T_a, b, T_b)
    else:
        touch = mate(a, T_a, b, T_b)
        angle = 0.0 if kind == "cone on rim" else float(np.degrees(touch.angle_rad))
        apart = touch.gap_m
        what = "the axis is tilted against the plane" if kind == "shaft on plane" else "the axes are turned"
        tilted = f"{what} by {angle:.4g} degrees"
        straighten = "0 are needed: turn the part"
        off = _APART.get(kind, "the cone is {:.4g} mm off its seat").format(1e3 * apart)
        meet = "move a goal until they meet"
        beside = "the faces have no length in common"
        common = touch.common
    varied = "vary" in case.key
    if angle > _ANGLE_DEG:
        raise _refuse(file, case, key, f"'{contact}': {tilted}", straighten)
    if apart > _GAP_M:
        raise _refuse(file, case, key, f"'{contact}': {off}", _ALONG if varied else meet)
    if not common:
        remedy = "vary by less" if varied else "move a goal until they do, or take the contact out"
        raise _refuse(file, case, key, f"'{contact}': {beside}", remedy)


def without_play(assembly: Assembly, clearance_mm: float) -> tuple[Contact, str] | None:
    """The first shaft that is as thick as its hole or thicker, and why: radii and clearance leave it no play."""
    for contact in (contact for operation in assembly.operations for contact in operation.contacts):
        a, b = map(assembly.face_of, contact)
        play = play_mm(a, b, clearance_mm) if contact_kind(a, b) == "shaft in hole" else None
        if play is not None and play <= _NO_PLAY_MM:
            why = f"{1e3 * geometric_play(a, b):.4g} mm per side by their sizes"
            fit = f" and {clearance_mm:g} mm of clearance" if assembly.is_fit(contact) else ", and neither is fit"
            return contact, f"'{contact}': the shaft has no play in the hole, {why}{fit}"
    return None


def check_clearance(scenario: Scenario, clearance_mm: float) -> None:
    """Check a clearance that is asked for in place of the scenario's.

    Raises:
        InputError: It leaves a shaft no play in its hole.
    """
    tight = without_play(scenario.assembly, clearance_mm)
    if tight is not None:
        raise InputError(f"a clearance of {clearance_mm:g} mm was given, with which {tight[1]}; give more.")


def _check_play(scenario: Scenario, file: str) -> None:
    """A shaft goes into a hole only if that is wider, by its size or by the clearance."""
    tight = without_play(scenario.assembly, scenario.clearance_mm)
    if tight is not None:
        contact, sentence = tight
        k = next(k for k, operation in enumerate(scenario.assembly.operations) if contact in operation.contacts)
        number = scenario.assembly.operations[k].contacts.index(contact) + 1
        raise InputError(
            f"{file}, operation {k + 1}, contacts, contact {number}: {sentence}; make the hole wider, or mark it as "
            "fit and give a clearance."
        )


def _check_intrusions(scenario: Scenario, file: str, case: _Case, stages: tuple[Poses, ...], apart: set[_Pair]) -> None:
    for a, b in combinations(scenario.assembly.solids, 2):
        _check_pair(scenario, file, case, f"parts, {b}, start", "at the start", (a, b), stages[0], apart)
    for k, operation in enumerate(scenario.assembly.operations):
        for pair in product(
            operation.moves, [part for part in scenario.assembly.solids if part not in operation.moves]
        ):
            place = f"after operation {k + 1}"
            _check_pair(scenario, file, case, f"operation {k + 1}, goal", place, pair, stages[k + 1], apart)


def _check_pair(
    scenario: Scenario,
    file: str,
    case: _Case,
    key: str,
    place: str,
    pair: tuple[str, str],
    poses: Poses,
    apart: set[_Pair],
) -> None:
    """Look at two parts, unless they were found apart before where they are to each other now."""
    a, b = pair
    known = (a, b, (np.round(pose.inverse(poses[a]) @ poses[b], 9) + 0.0).tobytes())
    if known in apart:
        return
    depth = intrusion(scenario.assembly.solids[a], poses[a], scenario.assembly.solids[b], poses[b])
    if depth > DEEP_M:
        sentence = f"'{a}' and '{b}' are {1e3 * depth:.4g} mm inside each other {place}"
        raise _refuse(file, case, key, sentence, "move one of them away")
    apart.add(known)
