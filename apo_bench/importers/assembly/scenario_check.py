"""Check a scenario file in stages, from syntax to simulated trials, and locate the line to change for each fault."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import product, takewhile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Plan, classify_contact, compute_placements
from apo_bench.errors import InputError
from apo_bench.geometry import is_held, measure_extent
from apo_bench.importers.assembly.contact_search import find_walls_without_play
from apo_bench.importers.assembly.posed_parts import TABLE
from apo_bench.importers.assembly.staging import find_stance
from apo_bench.io import format_count, read_bytes
from apo_bench.records import TrialConfig
from apo_bench.scenario import Scenario, list_nominal_operations, load_scenario, place_layout
from apo_bench.simulation.arm_checks.placing import place_in_reach
from apo_bench.simulation.arm_checks.plan_check import find_gripper_overlap
from apo_bench.simulation.execution import compute_transferred_poses, plan_moves, solve_key_angles
from apo_bench.simulation.scene import Scene, build_scene
from apo_bench.trial.run import run_trial

_ON_TABLE_M = 1e-4  # tolerance of "the part stands on the table"
_COLLISION_M = 1e-4  # depth of the open gripper in another part that counts as a collision
_SCREW = re.compile(r"(^|_)(m\d+(_|x|$)|screw|bolt|nut(_|$)|thread|spring)", re.IGNORECASE)
"""Names of screws, nuts and springs: no trial screws or bends parts."""
_REMEDIES = {
    "collision": "operation {k}, grasp: hold the part elsewhere, or let the struck part start farther away",
    "lost_grasp": "operation {k}, grasp: hold the part elsewhere",
    "force_stop": "operation {k}, attach: state another way, or give the parts more play",
    "unreachable": "site: move it nearer to the arm",
    "unreachable_start": "parts, {part}, start: let the part start nearer to the arm",
}
"""Failure code of a trial -> what to change; begins with a location as `_LOCATION` reads it."""
_LOCATION = re.compile(r"operation (\d+)(?:, (\w+))?|parts, (\w+)(?:, (\w+))?|site\b")
"""The location in the scenario file with which a sentence begins."""


class Finding(NamedTuple):
    """The result of one check."""

    what: str  # the stage: file, parts, starts, ways, play, gripper, reach or oracle
    ok: bool
    sentence: str
    line: int | None = None
    """The line of the file to change, from 1; None if the sentence names no location."""

    def __str__(self) -> str:
        """`wrong  reach    line 41: ...`."""
        line = f"line {self.line}: " if self.line else ""
        return f"{'ok' if self.ok else 'wrong':6} {self.what:8} {line}{self.sentence}"


def check_file(path: Path, seeds: int = 5, fidelity: str = "full", arm: str = "six_axis") -> Iterator[Finding]:
    """Check a scenario file from its syntax to trials in which the robot knows the true poses.

    Args:
        seeds: Number of trials; 0 runs none.
        fidelity, arm: As in `TrialConfig`.

    Yields:
        Each finding as soon as it is known.

    Raises:
        InputError: There is no such file.
    """
    text = read_bytes(path, "scenario file (.toml)").decode("utf-8", "replace")
    for finding in _list_findings(path, seeds, fidelity, arm):
        yield finding if finding.ok else finding._replace(line=find_line(text, finding.sentence))


def find_line(text: str, sentence: str) -> int | None:
    """Return the line, from 1, of the entry that a sentence names at its beginning; None if it names none.

    Such beginnings are `operation 2, grasp`, `parts, pin, start` or `site`. A missing key gives the line of its table.
    """
    named = _LOCATION.match(sentence)
    if named is None:
        return None
    operation, operation_key, part, part_key = named.groups()
    table = "[[operations]]" if operation else f"[parts.{part}]" if part else "[site]"
    lines = text.splitlines()
    heads = [i for i, line in enumerate(lines) if line.startswith(table)]
    k = int(operation) - 1 if operation else 0  # only [[operations]] has several tables of one head
    if not 0 <= k < len(heads):
        return None
    key = operation_key or part_key
    body = takewhile(lambda i: not lines[i].startswith("["), range(heads[k] + 1, len(lines)))
    return 1 + next((i for i in body if key and re.match(rf"{key}\s*=", lines[i])), heads[k])


def _list_findings(path: Path, seeds: int, fidelity: str, arm: str) -> Iterator[Finding]:
    """Yield the findings of all stages in order; a file that cannot be read or built ends the check."""
    try:
        scenario = load_scenario(path)
    except InputError as error:
        yield Finding("file", False, str(error).removeprefix(f"{path}, ").removeprefix(f"{path}: "))
        return
    yield Finding("file", True, _summarise(scenario))
    yield Finding("parts", True, _describe_names(scenario))
    yield from _run_check("starts", _check_starts(scenario), "every part stands at its start")
    yield from _run_check("ways", _check_insertions(scenario), "a straight way leads every part to its place")
    yield from _run_check("play", _check_play(scenario), "no part is held between walls without play")
    try:
        scene = build_scene(scenario, arm=arm)
    except InputError as error:
        # `operation 2: the grasp` names the key `grasp`.
        yield Finding("gripper", False, re.sub(r"^(operation \d+): the grasp", r"\1, grasp: that", str(error)))
        return
    yield from _run_check("gripper", _check_room_for_grasps(scenario, scene), "every part can be held and lifted")
    far = list(_check_reach(scenario, scene))
    yield from _run_check("reach", far, "the arm reaches every start and goal, wherever the site may be")
    # If something is out of reach, suggest a place of the site at which everything is in reach.
    if far and (place := place_in_reach(scene, lambda nearer: not any(_check_reach(nearer.scenario, nearer)))):
        yield Finding("reach", False, place)
    config = TrialConfig(str(path), arm=arm, noise_mm=0.0, noise_deg=0.0, method="oracle", fidelity=fidelity)
    failures = list(_check_trials(replace(config, clearance_mm=scene.clearance_mm), scenario, scene, seeds))
    yield from (Finding("oracle", False, sentence) for sentence in failures)
    if seeds:
        counted = f"{seeds - len(failures)} of {format_count(seeds, 'trial')}"
        sentence = f"{counted} in which the robot knows the true poses succeeded"
        yield Finding("oracle", not failures, sentence)


def _run_check(what: str, wrong: Iterable[str], well: str) -> Iterator[Finding]:
    """Yield a failed finding for each sentence of `wrong`, or one finding `well` if there is none."""
    findings = [Finding(what, False, sentence) for sentence in wrong]
    yield from findings or [Finding(what, True, well)]


def _summarise(scenario: Scenario) -> str:
    """Return the counts of parts, operations and contacts by kind; the table is no part."""
    assembly = scenario.assembly
    contacts = [contact for operation in assembly.operations for contact in operation.contacts]
    kinds = Counter(str(classify_contact(*map(assembly.face_of, contact))) for contact in contacts)
    counts = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))
    parts = len(assembly.solids) - (TABLE in assembly.solids)
    return f"{parts} parts, {len(assembly)} operations, {len(contacts)} contacts ({counts})"


def _describe_names(scenario: Scenario) -> str:
    """Return a sentence about the parts that are screws, nuts or springs by their names; the trials decide."""
    named = ", ".join(filter(_SCREW.search, scenario.assembly.solids))
    if not named:
        return "no part is a screw, nut or spring by its name"
    return f"{named}: by the name a screw, nut or spring; it is inserted straight, and nothing is screwed or bent"


def _check_starts(scenario: Scenario) -> Iterator[str]:
    """Yield a sentence for each movable part on the table that does not stand stably at its start."""
    for part, solid in scenario.assembly.solids.items():
        T = scenario.start[part]
        # Lowest point at z = 0; parts in fixtures are higher.
        is_on_table = abs(measure_extent(solid.pieces, T[2, :3])[0] + T[2, 3]) <= _ON_TABLE_M
        if part not in scenario.assembly.fixed and is_on_table and not find_stance(solid, T[:3, :3]).stands:
            yield (
                f"parts, {part}, start: '{part}' does not stand like this; give it a foot, or let it start in a "
                "fixture, as `scenario new` makes them"
            )


def _check_insertions(scenario: Scenario) -> Iterator[str]:
    """Yield a sentence for each operation without a collision-free straight insertion path."""
    for k, each in enumerate(list_nominal_operations(scenario), start=1):
        if not each.after.free:
            yield f"operation {k}, contacts: no straight way leads '{each.main}' to its goal; change the order"


def _check_play(scenario: Scenario) -> Iterator[str]:
    """Yield a sentence for each pair of opposite flat walls that hold a part without play, neither marked as fit."""
    assembly = scenario.assembly
    stages = compute_placements(assembly, scenario.start, scenario.nominal_poses)
    for k, (operation, poses) in enumerate(zip(assembly.operations, stages, strict=True), start=1):
        for contact, opposite in find_walls_without_play(assembly.solids, poses, operation.contacts):
            yield (
                f"operation {k}, contacts: '{contact}' and '{opposite}' leave no play; state fit = true for the faces "
                "of the slot in its part file, or make the part thinner"
            )


def _check_room_for_grasps(scenario: Scenario, scene: Scene) -> Iterator[str]:
    """Yield a sentence for each grasp that does not hold its part, and for each grasp without room for the gripper."""
    for k, (operation, grasp) in enumerate(zip(scenario.assembly.operations, scenario.grasps, strict=True), start=1):
        # The third row of R is world z in the part frame.
        up = scenario.start[operation.main][2, :3] if grasp.ahead is None else -grasp.ahead
        solid = scenario.assembly.solids[operation.main]
        if not is_held(solid, grasp.point, grasp.across, np.round(up, 9), scene.arm.opening_m):
            yield (
                f"operation {k}, grasp: between these pads '{operation.main}' has no opposite faces, and no shaft; "
                "hold it elsewhere"
            )
    # The open gripper must not collide with other parts when it takes each part, with the site at its nominal pose.
    layout = place_layout(scenario, *scenario.site.center_m, sum(scenario.site.yaw_rad) / 2, None, scene.clearance_mm)
    poses = layout.start
    for move in plan_moves(Plan(scenario.assembly, layout.start, layout.poses), scene, False):
        operation = scenario.assembly.operations[move.step.operation]
        after = compute_transferred_poses(operation, move.transfer.T_world_goal, poses)
        depth, other = find_gripper_overlap(scene, move.transfer, poses, after)
        if depth > _COLLISION_M:
            yield (
                f"operation {move.step.operation + 1}, grasp: the open gripper would be {1e3 * depth:.2g} mm deep in "
                f"'{other}', and no other place from above has room; let '{operation.main}' stand out higher"
            )
        poses = after


def _check_reach(scenario: Scenario, scene: Scene) -> Iterator[str]:
    """Yield a sentence for each part out of reach, with the site at its centre and at its four corners.

    At the centre the site has its mean yaw, at the corners the lowest or highest yaw. Each fault is told once per part.
    """
    site = scenario.site
    known = set[tuple[str, str]]()
    low, high = site.yaw_rad
    # Corners in units of the spread.
    places = {(0, 0, (low + high) / 2), *((i, j, low if i == j else high) for i, j in product((-1, 1), (-1, 1)))}
    for i, j, yaw in sorted(places):
        x, y = np.add(site.center_m, np.multiply((i, j), site.spread_m))
        layout = place_layout(scenario, x, y, yaw, None, scene.clearance_mm)
        for move in plan_moves(Plan(scenario.assembly, layout.start, layout.poses), scene, False):
            code = solve_key_angles(move.transfer, scene).code
            part = move.transfer.part
            if code and (code, part) not in known:
                known.add((code, part))
                k = move.step.operation + 1
                yield (
                    f"{_REMEDIES[code].format(k=k, part=part)}: the arm does not reach '{part}' in operation {k} with "
                    f"the site at ({1e3 * x:g}, {1e3 * y:g}) mm, turned by {np.degrees(yaw):g} degrees"
                )


def _check_trials(config: TrialConfig, scenario: Scenario, scene: Scene, seeds: int) -> Iterator[str]:
    """Yield a sentence for each trial that fails.

    Args:
        config: Settings of the trials; the seed is replaced by 0, 1, ..., `seeds` - 1.
    """
    for seed in range(seeds):
        record = run_trial(replace(config, seed=seed), scene)
        if record["success"]:
            continue
        k = record["failure_operation"]
        part = scenario.assembly.operations[k - 1].main if k else ""
        remedy = _REMEDIES.get(record["failure_code"] or "")
        change = f"{remedy.format(k=k, part=part)}: " if remedy else ""
        who = "the human" if record["failure_stage"] == "demonstrate" else "the robot"
        yield f"{change}{who} with seed {seed}: {str(record['sentence']).rstrip('.')}"
