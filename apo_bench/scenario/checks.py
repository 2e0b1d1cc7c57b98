"""Whether the numbers of a scenario fit its topology: contacts closed, parts apart, wherever the truth may vary to."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, product
from typing import NamedTuple

import numpy as np

from apo_bench.assembly.goals import Layout, Poses
from apo_bench.assembly.placement import placements
from apo_bench.assembly.topology import Contact
from apo_bench.errors import InputError
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.intrusion import intrusion
from apo_bench.geometry.overlap import overlap
from apo_bench.scenario.layout import layout_at
from apo_bench.scenario.order import check_order
from apo_bench.scenario.scenario import Scenario
from apo_bench.scenario.starts import in_the_air

_GAP_M = 1e-6
"""Faces that are said to touch are nearer than this."""
_ANGLE_DEG = 0.01
"""Normals of faces that are said to touch are opposite within this."""
_INTRUSION_M = 1e-6
"""Parts that only touch are less deep in each other."""


class Case(NamedTuple):
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
    for case in _cases(scenario):
        stages = (case.layout.start, *placements(scenario.assembly, case.layout.start, case.layout.goals))
        if not case.key:
            check_order(scenario.assembly, stages, file)
        _check_starts(scenario, file, case)
        _check_turns(scenario, file, case, stages)
        _check_contacts(scenario, file, case, stages)
        _check_intrusions(scenario, file, case, stages)


def _cases(scenario: Scenario) -> Iterator[Case]:
    site = scenario.site
    (x, y), middle = site.center_m, sum(site.yaw_rad) / 2
    yield Case(layout_at(scenario, x, y, middle))
    for i, shift in enumerate(scenario.shifts):
        for length in (shift.low_m, shift.high_m):
            shifts = [length if j == i else 0.0 for j in range(len(scenario.shifts))]
            words = f" when it is varied by {1e3 * length:g} mm"
            yield Case(layout_at(scenario, x, y, middle, shifts), f"operation {shift.operation + 1}, vary", words)
    for i, j, yaw in product((-1, 1), (-1, 1), sorted({middle, *site.yaw_rad})):
        x, y = site.center_m[0] + i * site.spread_m[0], site.center_m[1] + j * site.spread_m[1]
        words = f" when the site is at ({1e3 * x:g}, {1e3 * y:g}) mm, turned by {np.degrees(yaw):g} degrees"
        yield Case(layout_at(scenario, x, y, yaw), "site", words, site_only=True)


def _refuse(file: str, case: Case, key: str, sentence: str, remedy: str) -> InputError:
    return InputError(f"{file}, {case.key or key}: {sentence}{case.words}; {remedy}.")


def _check_starts(scenario: Scenario, file: str, case: Case) -> None:
    """Every movable part starts on something."""
    found = in_the_air(scenario.assembly, case.layout.start)
    if found is not None:
        part, sentence = found
        raise _refuse(file, case, f"parts, {part}, start, at_mm", sentence, "let it start on a part, such as the table")


def _check_turns(scenario: Scenario, file: str, case: Case, stages: tuple[Poses, ...]) -> None:
    """A part turns about the vertical only: the robot does not turn parts over."""
    for k, operation in enumerate(scenario.assembly.operations):
        before, after = stages[k][operation.main], stages[k + 1][operation.main]
        tilt = _angle_deg(before[:3, :3].T[:, 2], after[:3, :3].T[:, 2])
        if tilt > _ANGLE_DEG:
            raise _refuse(
                file,
                case,
                f"operation {k + 1}, goal, turn_deg",
                f"'{operation.main}' would have to be tilted by {tilt:.3g} degrees, only turns about the vertical are "
                "possible",
                "let it start tilted as it will lie",
            )


def _check_contacts(scenario: Scenario, file: str, case: Case, stages: tuple[Poses, ...]) -> None:
    for k, operation in enumerate(scenario.assembly.operations):
        for number, contact in enumerate(operation.contacts, start=1):
            if not case.site_only or _stays(scenario, contact):
                key = f"operation {k + 1}, contacts, contact {number}"
                _check_contact(scenario, file, case, key, contact, stages[k + 1])


def _stays(scenario: Scenario, contact: Contact) -> bool:
    """Whether the face below stays where it is when the site moves."""
    return contact.environment.part in scenario.assembly.fixed - scenario.follows_site


def _check_contact(scenario: Scenario, file: str, case: Case, key: str, contact: Contact, poses: Poses) -> None:
    face, on = scenario.assembly.face(contact.manipulated), scenario.assembly.face(contact.environment)
    T_face, T_on = poses[contact.manipulated.part], poses[contact.environment.part]
    n_face, n_on = T_face[:3, :3] @ face.normal, T_on[:3, :3] @ on.normal
    angle = _angle_deg(n_face, -n_on)
    if angle > _ANGLE_DEG:
        sentence = f"'{contact}': the faces look {180 - angle:.4g} degrees apart"
        raise _refuse(file, case, key, sentence, "180 are needed: turn the part, or name faces that look at each other")
    gap = float(n_on @ (pose.apply(T_face, face.outline).mean(axis=0) - pose.apply(T_on, on.outline[:1])[0]))
    if abs(gap) > _GAP_M:
        sentence = f"'{contact}': the faces are {1e3 * abs(gap):.4g} mm {'apart' if gap > 0 else 'too deep'}"
        remedy = (
            "vary along an axis that no contact fixes" if "vary" in case.key else "move a goal until they meet exactly"
        )
        raise _refuse(file, case, key, sentence, remedy)
    if not overlap(face, T_face, on, T_on):
        sentence = f"'{contact}': the faces lie in one plane but do not overlap"
        remedy = "vary by less" if "vary" in case.key else "move a goal until they do, or take the contact out"
        raise _refuse(file, case, key, sentence, remedy)


def _check_intrusions(scenario: Scenario, file: str, case: Case, stages: tuple[Poses, ...]) -> None:
    for a, b in combinations(scenario.assembly.solids, 2):
        _check_pair(scenario, file, case, f"parts, {b}, start", "at the start", (a, b), stages[0])
    for k, operation in enumerate(scenario.assembly.operations):
        others = [part for part in scenario.assembly.solids if part not in operation.moves]
        for pair in product(operation.moves, others):
            place = f"after operation {k + 1}"
            _check_pair(scenario, file, case, f"operation {k + 1}, goal", place, pair, stages[k + 1])


def _check_pair(
    scenario: Scenario, file: str, case: Case, key: str, place: str, pair: tuple[str, str], poses: Poses
) -> None:
    a, b = pair
    depth = intrusion(scenario.assembly.solids[a], poses[a], scenario.assembly.solids[b], poses[b])
    if depth > _INTRUSION_M:
        sentence = f"'{a}' and '{b}' are {1e3 * depth:.4g} mm inside each other {place}"
        raise _refuse(file, case, key, sentence, "move one of them away")


def _angle_deg(a: Array, b: Array) -> float:
    """The angle between two unit vectors, also where the cosine is flat."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))
