"""Whether human and robot can do a scenario, and which line of its file to change if not."""

import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np

from apo_bench.assembly.goals import Plan, placements
from apo_bench.assembly.kinds import contact_kind
from apo_bench.drafting.lines import line_of
from apo_bench.drafting.posed import TABLE
from apo_bench.drafting.standing import stance
from apo_bench.drafting.touching import walls_without_play
from apo_bench.errors import InputError
from apo_bench.geometry.solid import extent
from apo_bench.io.reading import read_bytes
from apo_bench.records.settings import TrialSettings
from apo_bench.scenario.file import load_scenario
from apo_bench.scenario.layout import layout_at
from apo_bench.scenario.nominal import nominal_operations
from apo_bench.scenario.scenario import Scenario
from apo_bench.simulation.execution.key_angles import key_angles
from apo_bench.simulation.execution.prepare import moves
from apo_bench.simulation.scene.scene import Scene, build_scene
from apo_bench.trial.trial import run_trial

_ON_TABLE_M = 1e-4
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
    "unreachable": "site: move it nearer to the arm, which stands at (-420, 0) mm",
    "unreachable_start": "parts, {part}, start: let the part wait nearer to the arm, which stands at (-420, 0) mm",
}
"""Outcome of a trial -> what to change."""


class Finding(NamedTuple):
    """One thing that was looked at."""

    what: str
    ok: bool
    sentence: str
    line: int | None = None
    """Of the file, from 1: what to change."""


def check_file(
    path: Path, seeds: int = 5, fidelity: str = "full", say: Callable[[Finding], None] = lambda found: None
) -> tuple[Finding, ...]:
    """Look at a scenario file from its syntax to trials in which the robot knows the truth.

    Args:
        say: Called with each finding as soon as it is there.

    Raises:
        InputError: There is no such file.
    """
    text = read_bytes(path, "scenario file (.toml)").decode("utf-8", "replace")
    found = list[Finding]()
    for each in _findings(path, seeds, fidelity):
        line = None if each.ok else line_of(text, each.sentence)
        found.append(each._replace(line=line))
        say(found[-1])
    return tuple(found)


def _findings(path: Path, seeds: int, fidelity: str) -> Iterator[Finding]:
    try:
        scenario = load_scenario(path)
    except InputError as error:
        yield Finding("file", False, str(error).removeprefix(f"{path}, ").removeprefix(f"{path}: "))
        return
    yield Finding("file", True, _counted(scenario))
    for what, looked in (("parts", _parts), ("starts", _starts), ("ways", _ways), ("play", _play)):
        wrong = list(looked(scenario))
        yield from (Finding(what, False, sentence) for sentence in wrong)
        if not wrong:
            yield Finding(what, True, _WELL[what])
    try:
        scene = build_scene(scenario)
    except InputError as error:
        yield Finding("gripper", False, _grasp_named(str(error)))
        return
    yield Finding("gripper", True, "every part can be held and lifted")
    wrong = list(_reach(scenario, scene))
    yield from (Finding("reach", False, sentence) for sentence in wrong)
    if not wrong:
        yield Finding("reach", True, "the arm reaches every start and goal, wherever the site may be")
    yield from _trials(path, scenario, scene, seeds, fidelity)


_WELL = {
    "parts": "no screw, nut or spring by its name",
    "starts": "every part stands where it waits",
    "ways": "a straight way leads every part to its place",
    "play": "no part is held between walls without play",
}


def _counted(scenario: Scenario) -> str:
    kinds = Counter(
        str(contact_kind(*map(scenario.assembly.face_of, contact)))
        for operation in scenario.assembly.operations
        for contact in operation.contacts
    )
    said = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))
    parts = len(scenario.assembly.solids) - (TABLE in scenario.assembly.solids)
    return f"{parts} parts, {len(scenario.assembly)} operations, {sum(kinds.values())} contacts ({said})"


def _parts(scenario: Scenario) -> Iterator[str]:
    for part in scenario.assembly.solids:
        for what, pattern in _NAMES.items():
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
                "cannot do; give it a foot, or let another part be fixed"
            )


def _ways(scenario: Scenario) -> Iterator[str]:
    for k, each in enumerate(nominal_operations(scenario), start=1):
        if not each.after.free:
            yield f"operation {k}, contacts: no straight way leads '{each.main}' to its goal; change the order"


def _play(scenario: Scenario) -> Iterator[str]:
    assembly = scenario.assembly
    stages = placements(assembly, scenario.start, scenario.goals)
    for k, (operation, poses) in enumerate(zip(assembly.operations, stages, strict=True), start=1):
        for one, other in walls_without_play(assembly.solids, poses, operation.contacts):
            yield (
                f"operation {k}, contacts: '{one}' and '{other}' leave no play; say fit = true of the faces of the "
                "slot in its part file, or make the part thinner"
            )


def _grasp_named(sentence: str) -> str:
    """`operation 2: the grasp` names the key `grasp`."""
    return re.sub(r"^(operation \d+): the grasp", r"\1, grasp: that", sentence)


def _reach(scenario: Scenario, scene: Scene) -> Iterator[str]:
    """In the middle of the site and at its corners, turned to either end."""
    site = scenario.site
    asked = set[str]()
    low, high = site.yaw_rad
    places = {(0, 0, (low + high) / 2), *((i, j, low if i == j else high) for i, j in product((-1, 1), (-1, 1)))}
    for i, j, yaw in sorted(places):
        x = site.center_m[0] + i * site.spread_m[0]
        y = site.center_m[1] + j * site.spread_m[1]
        layout = layout_at(scenario, x, y, yaw, None, scene.clearance_mm)
        for move in moves(Plan(scenario.assembly, layout.start, layout.goals), scene, False):
            code = key_angles(move.transfer, scene).code
            part = move.transfer.part
            if code and code + part not in asked:
                asked.add(code + part)
                where = f"with the site at ({1e3 * x:g}, {1e3 * y:g}) mm, turned by {np.degrees(yaw):g} degrees"
                remedy = _REMEDIES[code].format(k=move.step.operation + 1, part=part)
                yield f"{remedy}: the arm does not reach '{part}' in operation {move.step.operation + 1} {where}"


def _trials(path: Path, scenario: Scenario, scene: Scene, seeds: int, fidelity: str) -> Iterator[Finding]:
    right = 0
    asked = TrialSettings(
        str(path), level_mm=0.0, level_deg=0.0, clearance_mm=scene.clearance_mm, method="oracle", fidelity=fidelity
    )
    for seed in range(seeds):
        row = run_trial(replace(asked, seed=seed), scene)
        right += bool(row["success"])
        if not row["success"]:
            yield Finding("oracle", False, _failed(row, scenario))
    if seeds:
        yield Finding(
            "oracle", right == seeds, f"{right} of {seeds} trials in which the robot knows the truth are right"
        )


def _failed(row: object, scenario: Scenario) -> str:
    assert isinstance(row, dict)
    k = row["failure_operation"]
    code = str(row["failure_code"])
    part = scenario.assembly.operations[k - 1].main if k else ""
    remedy = _REMEDIES.get(code, "").format(k=k, part=part)
    who = "the human" if row["failure_stage"] == "demonstrate" else "the robot"
    told = f"{remedy}: " if remedy else ""
    ended = str(row["sentence"]).rstrip(".")
    return f"{told}{who} with seed {row['seed']}: {ended}"
