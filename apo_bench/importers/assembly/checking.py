"""Whether human and robot can do a scenario, and which line of its file to change if not."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import product, takewhile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from apo_bench.assembly import Plan, contact_kind, placements
from apo_bench.errors import InputError
from apo_bench.geometry import extent, is_held
from apo_bench.importers.assembly.posed import TABLE
from apo_bench.importers.assembly.touching import walls_without_play
from apo_bench.importers.assembly.waiting import stance
from apo_bench.io import read_bytes
from apo_bench.records import TrialConfig
from apo_bench.scenario import Scenario, layout_at, load_scenario, nominal_operations
from apo_bench.simulation.arm_checks.placing import place_in_reach
from apo_bench.simulation.arm_checks.plan_check import struck_by
from apo_bench.simulation.execution import after_transfer, key_angles, moves
from apo_bench.simulation.scene import Scene, build_scene
from apo_bench.trial.run import run_trial

_ON_TABLE_M = 1e-4
_STRUCK_M = 1e-4
_NAMES = {
    "screws and nuts are put in straight here, nothing is turned": re.compile(
        r"(^|_)(m\d+(_|x|$)|screw|bolt|nut(_|$)|thread)", re.IGNORECASE
    ),
    "springs are rigid here": re.compile(r"(^|_)spring", re.IGNORECASE),
}
"""What names of parts give away."""
_REMEDIES = {
    "collision": "operation {k}, grasp: hold the part elsewhere, or let what is struck start farther away",
    "lost_grasp": "operation {k}, grasp: hold the part elsewhere",
    "force_stop": "operation {k}, attach: state another way, or give the parts more play",
    "unreachable": "site: move it nearer to the arm, which stands at {base} mm",
    "unreachable_start": "parts, {part}, start: let the part wait nearer to the arm, which stands at {base} mm",
}
"""Outcome of a trial -> what to change."""
_NAMED = re.compile(r"operation (\d+)(?:, (\w+))?|parts, (\w+)(?:, (\w+))?|site\b")
"""What sentences about scenario files begin with."""


class Finding(NamedTuple):
    """One thing that was looked at."""

    what: str
    ok: bool
    sentence: str
    line: int | None = None
    """Of the file, from 1: what to change."""

    def __str__(self) -> str:
        """`wrong  reach    line 41: ...`."""
        line = f"line {self.line}: " if self.line else ""
        return f"{'ok' if self.ok else 'wrong':6} {self.what:8} {line}{self.sentence}"


def check_file(path: Path, seeds: int = 5, fidelity: str = "full", arm: str = "six_axis") -> Iterator[Finding]:
    """Look at a scenario file from its syntax to trials in which the robot knows the truth; each finding at once.

    Raises:
        InputError: There is no such file.
    """
    text = read_bytes(path, "scenario file (.toml)").decode("utf-8", "replace")
    for finding in _findings(path, seeds, fidelity, arm):
        yield finding if finding.ok else finding._replace(line=line_of(text, finding.sentence))


def line_of(text: str, sentence: str) -> int | None:
    """The line, from 1, of `operation 2, grasp` or `parts, pin, start`, with which sentences about files begin.

    Of a key that is not there: the line of its table.
    """
    named = _NAMED.match(sentence)
    if named is None:
        return None
    operation, operation_key, part, part_key = named.groups()
    table = "[[operations]]" if operation else f"[parts.{part}]" if part else "[site]"
    lines = text.splitlines()
    heads = [i for i, line in enumerate(lines) if line.startswith(table)]
    k = int(operation) - 1 if operation else 0
    if not 0 <= k < len(heads):
        return None
    key = operation_key or part_key
    body = takewhile(lambda i: not lines[i].startswith("["), range(heads[k] + 1, len(lines)))
    return 1 + next((i for i in body if key and re.match(rf"{key}\s*=", lines[i])), heads[k])


def _findings(path: Path, seeds: int, fidelity: str, arm: str) -> Iterator[Finding]:
    try:
        scenario = load_scenario(path)
    except InputError as error:
        yield Finding("file", False, str(error).removeprefix(f"{path}, ").removeprefix(f"{path}: "))
        return
    yield Finding("file", True, _counted(scenario))
    for what, look, well in (
        ("parts", _parts, "no screw, nut or spring by its name"),
        ("starts", _starts, "every part stands where it waits"),
        ("ways", _ways, "a straight way leads every part to its place"),
        ("play", _play, "no part is held between walls without play"),
    ):
        yield from _looked(what, look(scenario), well)
    try:
        scene = build_scene(scenario, arm=arm)
    except InputError as error:
        # `operation 2: the grasp` names the key `grasp`.
        sentence = re.sub(r"^(operation \d+): the grasp", r"\1, grasp: that", str(error))
        yield Finding("gripper", False, sentence)
        return
    yield from _looked("gripper", _room(scenario, scene), "every part can be held and lifted")
    far = list(_reach(scenario, scene))
    yield from _looked("reach", far, "the arm reaches every start and goal, wherever the site may be")
    if far and (place := place_in_reach(scene, lambda nearer: not any(_reach(nearer.scenario, nearer)))):
        yield Finding("reach", False, place)
    yield from _trials(replace(_ideal(path, arm), fidelity=fidelity), scenario, scene, seeds)


def _looked(what: str, wrong: Iterable[str], well: str) -> Iterator[Finding]:
    """What is wrong, or one finding that all is well."""
    findings = [Finding(what, False, sentence) for sentence in wrong]
    yield from findings or [Finding(what, True, well)]


def _counted(scenario: Scenario) -> str:
    assembly = scenario.assembly
    contacts = [contact for operation in assembly.operations for contact in operation.contacts]
    kinds = Counter(str(contact_kind(*map(assembly.face_of, contact))) for contact in contacts)
    counts = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))
    parts = len(assembly.solids) - (TABLE in assembly.solids)
    return f"{parts} parts, {len(assembly)} operations, {len(contacts)} contacts ({counts})"


def _parts(scenario: Scenario) -> Iterator[str]:
    for part, (what, pattern) in product(scenario.assembly.solids, _NAMES.items()):
        if pattern.search(part):
            yield f"parts, {part}: by its name, and {what}; leave it out, or give it another name"


def _starts(scenario: Scenario) -> Iterator[str]:
    for part, solid in scenario.assembly.solids.items():
        T = scenario.start[part]
        if part in scenario.assembly.fixed or abs(extent(solid.pieces, T[2, :3])[0] + T[2, 3]) > _ON_TABLE_M:
            continue
        if not stance(solid, T[:3, :3]).stands:
            yield (
                f"parts, {part}, start: '{part}' does not stand like this and needs turning over, which the robot "
                "cannot do; give it a foot, or let it wait in a nest, as `scenario new` makes them"
            )


def _ways(scenario: Scenario) -> Iterator[str]:
    for k, each in enumerate(nominal_operations(scenario), start=1):
        if not each.after.free:
            yield f"operation {k}, contacts: no straight way leads '{each.main}' to its goal; change the order"


def _play(scenario: Scenario) -> Iterator[str]:
    assembly = scenario.assembly
    stages = placements(assembly, scenario.start, scenario.goals)
    for k, (operation, poses) in enumerate(zip(assembly.operations, stages, strict=True), start=1):
        for contact, opposite in walls_without_play(assembly.solids, poses, operation.contacts):
            yield (
                f"operation {k}, contacts: '{contact}' and '{opposite}' leave no play; say fit = true of the faces of "
                "the slot in its part file, or make the part thinner"
            )


def _room(scenario: Scenario, scene: Scene) -> Iterator[str]:
    """Grasps between whose pads a part does not lie, and those at which the gripper has no room."""
    for k, (operation, grasp) in enumerate(zip(scenario.assembly.operations, scenario.grasps, strict=True), start=1):
        up = scenario.start[operation.main][2, :3] if grasp.ahead is None else -grasp.ahead
        solid = scenario.assembly.solids[operation.main]
        if not is_held(solid, grasp.point, grasp.across, np.round(up, 9), scene.arm.opening_m):
            yield (
                f"operation {k}, grasp: between these pads '{operation.main}' has no opposite faces, and no shaft; "
                "hold it elsewhere"
            )
    layout = layout_at(scenario, *scenario.site.center_m, sum(scenario.site.yaw_rad) / 2, None, scene.clearance_mm)
    believed = layout.start
    for move in moves(Plan(scenario.assembly, layout.start, layout.poses), scene, False):
        operation = scenario.assembly.operations[move.step.operation]
        after = after_transfer(operation, move.transfer.T_world_goal, believed)
        depth, other = struck_by(scene, move.transfer, believed, after)
        if depth > _STRUCK_M:
            yield (
                f"operation {move.step.operation + 1}, grasp: the open gripper would be {1e3 * depth:.2g} mm deep in "
                f"'{other}' here, and no other place from above has room; let '{operation.main}' stand out higher"
            )
        believed = after


def _reach(scenario: Scenario, scene: Scene) -> Iterator[str]:
    """In the middle of the site and at its corners, turned to either end."""
    site = scenario.site
    known = set[str]()
    low, high = site.yaw_rad
    places = {(0, 0, (low + high) / 2), *((i, j, low if i == j else high) for i, j in product((-1, 1), (-1, 1)))}
    for i, j, yaw in sorted(places):
        x, y = np.add(site.center_m, np.multiply((i, j), site.spread_m))
        layout = layout_at(scenario, x, y, yaw, None, scene.clearance_mm)
        for move in moves(Plan(scenario.assembly, layout.start, layout.poses), scene, False):
            code = key_angles(move.transfer, scene).code
            part = move.transfer.part
            if code and code + part not in known:
                known.add(code + part)
                k = move.step.operation + 1
                remedy = _REMEDIES[code].format(k=k, part=part, base=_base(scene))
                yield (
                    f"{remedy}: the arm does not reach '{part}' in operation {k} with the site at "
                    f"({1e3 * x:g}, {1e3 * y:g}) mm, turned by {np.degrees(yaw):g} degrees"
                )


def _ideal(path: Path, arm: str) -> TrialConfig:
    """A trial in which the robot knows the truth."""
    return TrialConfig(str(path), arm=arm, noise_mm=0.0, noise_deg=0.0, method="oracle")


def _base(scene: Scene) -> str:
    """`(-420, 0)`: where the arm stands, [mm]."""
    return f"({1e3 * scene.arm.base[0]:g}, {1e3 * scene.arm.base[1]:g})"


def _trials(settings: TrialConfig, scenario: Scenario, scene: Scene, seeds: int) -> Iterator[Finding]:
    settings = replace(settings, clearance_mm=scene.clearance_mm)
    failed = 0
    for seed in range(seeds):
        row = run_trial(replace(settings, seed=seed), scene)
        if not row["success"]:
            failed += 1
            yield Finding("oracle", False, _failed(row, scenario, _base(scene)))
    if seeds:
        sentence = f"{seeds - failed} of {seeds} trials in which the robot knows the truth are right"
        yield Finding("oracle", not failed, sentence)


def _failed(row: Mapping[str, Any], scenario: Scenario, base: str) -> str:
    """What went wrong in a trial, after what to change."""
    k = row["failure_operation"]
    part = scenario.assembly.operations[k - 1].main if k else ""
    remedy = _REMEDIES.get(row["failure_code"])
    change = f"{remedy.format(k=k, part=part, base=base)}: " if remedy else ""
    who = "the human" if row["failure_stage"] == "demonstrate" else "the robot"
    return f"{change}{who} with seed {row['seed']}: {row['sentence'].rstrip('.')}"
