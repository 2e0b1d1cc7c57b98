"""Check that the poses of a scenario agree with its contacts, in the nominal layout and at the limits of variation."""

from collections.abc import Iterator
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Contact, Layout, Poses, classify_contact, compute_placements, measure_height
from apo_bench.errors import InputError, require
from apo_bench.geometry import Face, compute_overlap, measure_angle, measure_intrusion, measure_mate, pose
from apo_bench.scenario.layout import place_layout
from apo_bench.scenario.operation_order import check_order, find_floating_part
from apo_bench.scenario.play import without_play
from apo_bench.scenario.scenario import Scenario

_GAP_M = 1e-6
"""Largest gap between the faces of a contact."""
_ANGLE_DEG = 0.01
"""Largest angle between one normal and the opposite of the other, or between the axes, of a contact."""
DEEP_M = 2e-5
"""Largest overlap of parts that only touch; pieces of imported parts may overlap that much."""

_Pair = tuple[str, str, bytes]
"""Two parts, and the rounded pose of the second in the frame of the first, as bytes."""
_Faults = Iterator[tuple[str, str]]
"""Key in the file that causes a fault, and the fault as a sentence."""


class _LayoutCase(NamedTuple):
    """A layout to check."""

    layout: Layout
    key: str = ""
    """Key in the file that causes a fault in this layout; empty for the nominal layout."""
    words: str = ""
    """Description of the layout, appended to a sentence."""
    site_only: bool = False
    """True if only the site differs from the nominal layout, so that parts which move with it need no second check."""


def check_layouts(scenario: Scenario, file: str) -> None:
    """Check the nominal layout, both ends of every `vary`, and the corners of the site.

    Raises:
        InputError: The first fault that is found.
    """
    tight = without_play(scenario.assembly, scenario.clearance_mm)
    require(tight is None, f"{file}, operations, contacts: {tight}; make the hole wider, or fit with a clearance.")
    apart: set[_Pair] = set()
    for case in _list_layout_cases(scenario):
        stages = (case.layout.start, *compute_placements(scenario.assembly, case.layout.start, case.layout.poses))
        if not case.key:
            check_order(scenario.assembly, stages, file)
        for key, fault in _list_faults(scenario, case, stages, apart):
            raise InputError(f"{file}, {case.key or key}: {fault}{case.words}.")


def _list_layout_cases(scenario: Scenario) -> Iterator[_LayoutCase]:
    """Yield the layouts to check: nominal, both ends of every shift and turn, and the corners of the site."""
    site = scenario.site
    x, y = site.center_m
    middle = sum(site.yaw_rad) / 2
    yield _LayoutCase(place_layout(scenario, x, y, middle))
    for i, shift in enumerate(scenario.shifts):
        for length in (shift.low_m, shift.high_m):
            shifts = [length if j == i else 0.0 for j in range(len(scenario.shifts))]
            words = f" when it is varied by {1e3 * length:g} mm"
            yield _LayoutCase(
                place_layout(scenario, x, y, middle, shifts), f"operation {shift.operation + 1}, vary", words
            )
    for i, turn in enumerate(scenario.turns):
        for angle in (turn.low_rad, turn.high_rad):
            turns = [angle if j == i else 0.0 for j in range(len(scenario.turns))]
            words = f" when it is turned by {np.degrees(angle):g} degrees"
            yield _LayoutCase(
                place_layout(scenario, x, y, middle, turns_rad=turns), f"operation {turn.operation + 1}, vary", words
            )
    for i, j, yaw in product((-1, 1), (-1, 1), sorted({middle, *site.yaw_rad})):
        x = site.center_m[0] + i * site.spread_m[0]
        y = site.center_m[1] + j * site.spread_m[1]
        words = f" when the site is at ({1e3 * x:g}, {1e3 * y:g}) mm, turned by {np.degrees(yaw):g} degrees"
        yield _LayoutCase(place_layout(scenario, x, y, yaw), "site", words, site_only=True)


def _list_faults(scenario: Scenario, case: _LayoutCase, stages: tuple[Poses, ...], apart: set[_Pair]) -> _Faults:
    """Yield all faults of one layout.

    Args:
        stages: Poses of all parts at the start and after each operation.
        apart: Pairs of parts that were found apart before; extended.
    """
    airborne = find_floating_part(scenario.assembly, case.layout.start)
    if airborne is not None:
        part, sentence = airborne
        yield f"parts, {part}, start, at_mm", sentence
    yield from _find_tilted_parts(scenario, stages)
    yield from _find_open_contacts(scenario, case, stages)
    yield from _find_overlaps(scenario, stages, apart)


def _find_tilted_parts(scenario: Scenario, stages: tuple[Poses, ...]) -> _Faults:
    """Yield operations that tilt a part, since the robot turns parts about the vertical only."""
    for k, operation in enumerate(scenario.assembly.operations):
        before = stages[k][operation.main]
        tilt = float(np.degrees(measure_angle(before[2, :3], stages[k + 1][operation.main][2, :3])))
        if tilt > _ANGLE_DEG:
            yield (
                f"operation {k + 1}, goal, turn_deg",
                f"'{operation.main}' would have to be tilted by {tilt:.3g} degrees, which the robot cannot do",
            )


def _find_open_contacts(scenario: Scenario, case: _LayoutCase, stages: tuple[Poses, ...]) -> _Faults:
    """Yield contacts that are not closed after the operation that makes them."""
    standing = scenario.assembly.fixed - scenario.follows_site
    for k, operation in enumerate(scenario.assembly.operations):
        for number, contact in enumerate(operation.contacts, start=1):
            # If only the site moves, a contact changes only if its environment part does not move with the site.
            if not case.site_only or contact.environment.part in standing:
                fault = _describe_open_contact(scenario, contact, stages[k + 1])
                if fault is not None:
                    yield f"operation {k + 1}, contacts, contact {number}", f"'{contact}': {fault}"


def _describe_open_contact(scenario: Scenario, contact: Contact, poses: Poses) -> str | None:
    """The reason why a contact is not closed, in words: tilt, gap or no overlap; None if it is closed."""
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


def _find_overlaps(scenario: Scenario, stages: tuple[Poses, ...], apart: set[_Pair]) -> _Faults:
    """Yield pairs of parts that overlap at the start or after an operation."""
    solids = scenario.assembly.solids
    for a, b in combinations(solids, 2):
        depth = _measure_overlap_depth(scenario, (a, b), stages[0], apart)
        if depth > DEEP_M:
            yield f"parts, {b}, start", f"'{a}' and '{b}' are {1e3 * depth:.4g} mm inside each other at the start"
    for k, operation in enumerate(scenario.assembly.operations):
        for a, b in product(operation.moves, [part for part in solids if part not in operation.moves]):
            depth = _measure_overlap_depth(scenario, (a, b), stages[k + 1], apart)
            if depth > DEEP_M:
                sentence = f"'{a}' and '{b}' are {1e3 * depth:.4g} mm inside each other after operation {k + 1}"
                yield f"operation {k + 1}, goal", sentence


def _measure_overlap_depth(scenario: Scenario, pair: tuple[str, str], poses: Poses, apart: set[_Pair]) -> float:
    """The depth of overlap of two parts, [m]; 0 if `apart` contains the pair at its present relative pose."""
    a, b = pair
    known = (a, b, (np.round(pose.inverse(poses[a]) @ poses[b], 9) + 0.0).tobytes())
    if known in apart:
        return 0.0
    depth = measure_intrusion(scenario.assembly.solids[a], poses[a], scenario.assembly.solids[b], poses[b])
    if depth <= DEEP_M:
        apart.add(known)
    return depth
