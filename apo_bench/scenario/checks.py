"""Checks that the numbers of a scenario fit its topology, wherever the truth may vary to."""

from collections.abc import Iterator
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Contact, Layout, Poses, classify_contact, compute_placements, measure_height
from apo_bench.errors import InputError, require
from apo_bench.geometry import Face, compute_overlap, measure_angle, measure_intrusion, measure_mate, pose
from apo_bench.scenario.layout import place_layout
from apo_bench.scenario.order import check_order, find_part_in_the_air
from apo_bench.scenario.play import without_play
from apo_bench.scenario.scenario import Scenario

_GAP_M = 1e-6
"""Faces of a contact are nearer than this."""
_ANGLE_DEG = 0.01
"""Normals of faces of a contact are opposite within this, and axes parallel."""
DEEP_M = 2e-5
"""Parts that are deeper in each other do not only touch: pieces of an import may be so deep."""

_Pair = tuple[str, str, bytes]
"""Two parts, and where the second one is to the first."""
_Faults = Iterator[tuple[str, str]]
"""Key to blame, and what is wrong."""


class _Case(NamedTuple):
    """A layout that the scenario can draw."""

    layout: Layout
    key: str = ""
    """The key to blame for what is wrong only here."""
    words: str = ""
    """Where it is, to follow a sentence."""
    site_only: bool = False
    """Only the site differs from the nominal layout: what moves as one needs no second look."""


def check_layouts(scenario: Scenario, file: str) -> None:
    """Check the nominal layout, both ends of every `vary`, and the corners of the site.

    Raises:
        InputError: The first thing found wrong.
    """
    tight = without_play(scenario.assembly, scenario.clearance_mm)
    require(tight is None, f"{file}, operations, contacts: {tight}; make the hole wider, or fit with a clearance.")
    apart: set[_Pair] = set()
    for case in _cases(scenario):
        stages = (case.layout.start, *compute_placements(scenario.assembly, case.layout.start, case.layout.poses))
        if not case.key:
            check_order(scenario.assembly, stages, file)
        for key, fault in _faults(scenario, case, stages, apart):
            raise InputError(f"{file}, {case.key or key}: {fault}{case.words}.")


def _cases(scenario: Scenario) -> Iterator[_Case]:
    site = scenario.site
    x, y = site.center_m
    middle = sum(site.yaw_rad) / 2
    yield _Case(place_layout(scenario, x, y, middle))
    for i, shift in enumerate(scenario.shifts):
        for length in (shift.low_m, shift.high_m):
            shifts = [length if j == i else 0.0 for j in range(len(scenario.shifts))]
            words = f" when it is varied by {1e3 * length:g} mm"
            yield _Case(place_layout(scenario, x, y, middle, shifts), f"operation {shift.operation + 1}, vary", words)
    for i, turn in enumerate(scenario.turns):
        for angle in (turn.low_rad, turn.high_rad):
            turns = [angle if j == i else 0.0 for j in range(len(scenario.turns))]
            words = f" when it is turned by {np.degrees(angle):g} degrees"
            yield _Case(
                place_layout(scenario, x, y, middle, turns_rad=turns), f"operation {turn.operation + 1}, vary", words
            )
    for i, j, yaw in product((-1, 1), (-1, 1), sorted({middle, *site.yaw_rad})):
        x = site.center_m[0] + i * site.spread_m[0]
        y = site.center_m[1] + j * site.spread_m[1]
        words = f" when the site is at ({1e3 * x:g}, {1e3 * y:g}) mm, turned by {np.degrees(yaw):g} degrees"
        yield _Case(place_layout(scenario, x, y, yaw), "site", words, site_only=True)


def _faults(scenario: Scenario, case: _Case, stages: tuple[Poses, ...], apart: set[_Pair]) -> _Faults:
    """All that is wrong in one layout."""
    airborne = find_part_in_the_air(scenario.assembly, case.layout.start)
    if airborne is not None:
        part, sentence = airborne
        yield f"parts, {part}, start, at_mm", sentence
    yield from _tilted_parts(scenario, stages)
    yield from _open_contacts(scenario, case, stages)
    yield from _intrusions(scenario, stages, apart)


def _tilted_parts(scenario: Scenario, stages: tuple[Poses, ...]) -> _Faults:
    """Parts that do not turn about the vertical only: the robot does not turn parts over."""
    for k, operation in enumerate(scenario.assembly.operations):
        before = stages[k][operation.main]
        tilt = float(np.degrees(measure_angle(before[2, :3], stages[k + 1][operation.main][2, :3])))
        if tilt > _ANGLE_DEG:
            yield (
                f"operation {k + 1}, goal, turn_deg",
                f"'{operation.main}' would have to be tilted by {tilt:.3g} degrees, which the robot cannot do",
            )


def _open_contacts(scenario: Scenario, case: _Case, stages: tuple[Poses, ...]) -> _Faults:
    """Contacts that are not closed after the operation that makes them."""
    standing = scenario.assembly.fixed - scenario.follows_site
    for k, operation in enumerate(scenario.assembly.operations):
        for number, contact in enumerate(operation.contacts, start=1):
            # When only the site moves, a contact is another one if the face below stays where it is.
            if not case.site_only or contact.environment.part in standing:
                fault = _find_gap(scenario, contact, stages[k + 1])
                if fault is not None:
                    yield f"operation {k + 1}, contacts, contact {number}", f"'{contact}': {fault}"


def _find_gap(scenario: Scenario, contact: Contact, poses: Poses) -> str | None:
    """Why a contact is not closed: faces do not look at each other, do not meet, or cover nothing of each other."""
    a, b = map(scenario.assembly.face_of, contact)
    T_a, T_b = (poses[of.part] for of in contact)
    if isinstance(a, Face) and isinstance(b, Face):
        angle = float(np.degrees(measure_angle(T_a[:3, :3] @ a.normal, -T_b[:3, :3] @ b.normal)))
        above = measure_height(a, T_a, b, T_b)
        tilted = f"the faces look {180 - angle:.4g} degrees apart, 180 are needed"
        off = f"the faces are {1e3 * abs(above):.4g} mm {'apart' if above > 0 else 'too deep'}"
        common = compute_overlap(a, T_a, b, T_b)
    else:
        touch = measure_mate(a, T_a, b, T_b)
        angle = 0.0 if classify_contact(a, b) == "cone on rim" else float(np.degrees(touch.angle_rad))
        above = touch.gap_m
        tilted = f"the axes are turned by {angle:.4g} degrees, 0 are needed"
        off = f"the faces are {1e3 * above:.4g} mm off each other"
        common = touch.common
    if angle > _ANGLE_DEG:
        return tilted
    if abs(above) > _GAP_M:
        return off
    return None if common else "the faces do not overlap"


def _intrusions(scenario: Scenario, stages: tuple[Poses, ...], apart: set[_Pair]) -> _Faults:
    """Parts that are inside each other, at the start or after an operation."""
    solids = scenario.assembly.solids
    for a, b in combinations(solids, 2):
        depth = _depth(scenario, (a, b), stages[0], apart)
        if depth > DEEP_M:
            yield f"parts, {b}, start", f"'{a}' and '{b}' are {1e3 * depth:.4g} mm inside each other at the start"
    for k, operation in enumerate(scenario.assembly.operations):
        for a, b in product(operation.moves, [part for part in solids if part not in operation.moves]):
            depth = _depth(scenario, (a, b), stages[k + 1], apart)
            if depth > DEEP_M:
                sentence = f"'{a}' and '{b}' are {1e3 * depth:.4g} mm inside each other after operation {k + 1}"
                yield f"operation {k + 1}, goal", sentence


def _depth(scenario: Scenario, pair: tuple[str, str], poses: Poses, apart: set[_Pair]) -> float:
    """How deep two parts are in each other, [m]; 0 if they were found apart before where they are to each other now."""
    a, b = pair
    known = (a, b, (np.round(pose.inverse(poses[a]) @ poses[b], 9) + 0.0).tobytes())
    if known in apart:
        return 0.0
    depth = measure_intrusion(scenario.assembly.solids[a], poses[a], scenario.assembly.solids[b], poses[b])
    if depth <= DEEP_M:
        apart.add(known)
    return depth
