"""Observations and plans from their JSON forms, which `json_forms` describes.

One file of more than 250 lines: both forms are made of the same pieces, each of which says what is wrong with it.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from apo_bench.assembly import (
    SCHEDULE_REMEDY,
    Assembly,
    Observation,
    OutlierModel,
    Plan,
    Poses,
    SharedError,
    Step,
    Tails,
    schedule_fault,
)
from apo_bench.errors import InputError, require_known
from apo_bench.files.csv_form import ALLOWED_DEVIATIONS, SHIFT_M, TURN_RAD, is_sensible, is_within
from apo_bench.files.json_forms import OBSERVATION_SCHEMA, OUTLIER_KEYS, PLAN_SCHEMA, TO_MM_DEG
from apo_bench.geometry import Array, pose
from apo_bench.io import JsonNode, read_json
from apo_bench.scenario import Scenario, layout_at

_LEAST_FREEDOM = 0.4
_DEVIATIONS = ("deviation_mm", "deviation_deg")
_POSE = ("position_mm", "quaternion_wxyz")


def read_json_observation(path: str | Path, scenario: Scenario | None = None) -> Observation:
    """An observation from its file, measured or written by `write_form`.

    `start` and `gap_mm` (default: the scenario's), `play_mm` (default: the scenario's `clearance_mm`), `outliers`
    (default: not known) and `seen` (default: true) may be left out. Instead of `covariance_mm_deg`, `deviation_mm` and
    `deviation_deg` state one standard deviation for the three directions and one for the three turns.

    Args:
        scenario: The scenario the file must be of; by default the one it names, where a relative path to a
            `.toml` file counts from the folder of the file.

    Raises:
        InputError: Anything in the file that is not as described, naming file and key.
    """
    return read_json_observed(path, scenario, None)[0]


def read_json_observed(
    path: str | Path, scenario: Scenario | None, assumed: tuple[float, float] | None
) -> tuple[Observation, bool]:
    """An observation from its file, and whether a standard deviation had to be assumed.

    Args:
        assumed: The deviations, mm and degrees, of operations that state none; None allows no such operation.
    """
    optional = ("start", "gap_mm", "play_mm", "outliers", "shared", "tails")
    root = read_json(path).fields_of(OBSERVATION_SCHEMA, ("scenario", "operations"), optional)
    loaded = _scenario(root["scenario"], scenario, Path(path).parent)
    stated = ("covariance_mm_deg", "deviation_mm", "deviation_deg", "seen")
    entries = _operations(root["operations"], loaded.assembly, (), stated)
    shared = root["shared"].items("shared error") if "shared" in root else ()
    observation = Observation(
        assembly=loaded.assembly,
        start=_poses(root["start"], loaded) if "start" in root else _own_start(loaded),
        goals=np.array([_pose(entry) for entry in entries]).reshape(-1, 4, 4),
        covariance=np.array([_stated(entry, assumed) for entry in entries]).reshape(-1, 6, 6),
        seen=np.array([entry["seen"].flag() if "seen" in entry else True for entry in entries]),
        gap_m=root["gap_mm"].number(0.0, above=True) * 1e-3 if "gap_mm" in root else loaded.gap_mm * 1e-3,
        play_m=root["play_mm"].number(0.0) * 1e-3 if "play_mm" in root else loaded.clearance_mm * 1e-3,
        outliers=_outliers(root["outliers"]) if "outliers" in root else None,
        shared=tuple(_shared(node, len(loaded.assembly)) for node in shared),
        tails=_tails(root["tails"], len(loaded.assembly)) if "tails" in root else None,
    )
    complete = all("covariance_mm_deg" in entry or "deviation_mm" in entry for entry in entries)
    return observation, not complete


def read_plan(path: str | Path, scenario: Scenario | None = None) -> Plan:
    """A plan from its file; see `read_json_observation` for `scenario` and errors."""
    root = read_json(path).fields_of(PLAN_SCHEMA, ("scenario", "start", "operations", "schedule"))
    loaded = _scenario(root["scenario"], scenario, Path(path).parent)
    goals = np.array([_pose(entry) for entry in _operations(root["operations"], loaded.assembly, (), ())])
    steps = [_step(node, goals) for node in root["schedule"].items("schedule entry")]
    schedule = tuple(step for step, _ in steps)
    if steps and (wrong := schedule_fault(schedule, len(goals))):
        raise InputError(f"{path}, schedule: it {wrong}; {SCHEDULE_REMEDY}.")
    targets = np.array([T for _, T in steps] or goals)
    return Plan(loaded.assembly, _poses(root["start"], loaded), goals, schedule, targets)


def _outliers(node: JsonNode) -> OutlierModel:
    """How often observations are worse than they state; what is not said is as usual."""
    keys = node.fields((), (*OUTLIER_KEYS, "camera_mm"))
    rates: dict[str, Any] = {OUTLIER_KEYS[key]: value.number(0.0) for key, value in keys.items() if key in OUTLIER_KEYS}
    if "camera_mm" in keys:
        rates["camera_m"] = tuple((keys["camera_mm"].numbers(3) * 1e-3).tolist())
    try:
        return replace(OutlierModel(), **rates)
    except InputError as error:
        raise InputError(f"{node.file}, {node.key}: {error}") from error


def _own_start(scenario: Scenario) -> Poses:
    """Where the scenario's parts start, those with clearance let down to rest."""
    return layout_at(scenario, 0.0, 0.0, 0.0, clearance_mm=scenario.clearance_mm).start


def _shared(node: JsonNode, n: int) -> SharedError:
    """An error that operations share."""
    fields = node.fields(("name", "operations", "covariance_mm_deg"), ("frame", "local", "correlation"))
    operations = tuple(entry.integer() - 1 for entry in fields["operations"].items("operation"))
    fields["operations"].require(
        operations and len(set(operations)) == len(operations) and all(0 <= k < n for k in operations),
        f"operations from 1 to {n}, each once, are needed",
    )
    fields.get("local", node).require(
        "local" not in fields or "frame" in fields, "a frame is needed with it", "state the frame, or leave this out"
    )
    m = len(operations)
    correlation = None
    if "correlation" in fields:
        correlation = fields["correlation"].numbers(m, m)
        fields["correlation"].require(
            np.abs(correlation - correlation.T).max() <= 1e-9 and np.abs(np.diag(correlation) - 1.0).max() <= 1e-9,
            "a symmetric matrix with 1 on its diagonal is needed",
        )
    return SharedError(
        name=fields["name"].text(),
        operations=operations,
        covariance=_covariance(fields["covariance_mm_deg"], definite=False),
        frame=_pose(fields["frame"].fields(_POSE)) if "frame" in fields else None,
        local=fields["local"].flag() if "local" in fields else False,
        correlation=correlation,
    )


def _tails(node: JsonNode, n: int) -> Tails:
    """How errors are distributed."""
    keys = ("axes", "scales_mm_deg", "degrees_of_freedom", "deviations_mm_deg", "limits_mm_deg", "joined")
    fields = node.fields(keys)
    units = TO_MM_DEG[[0, 0, 3, 3]]
    axes = fields["axes"].numbers(n, 3, 3)
    fields["axes"].require(
        np.abs(axes @ np.swapaxes(axes, 1, 2) - np.eye(3)).max(initial=0.0) <= 1e-6,
        "a rotation matrix for each operation is needed",
    )
    matrices = {key: fields[key].numbers(2 if key == "limits_mm_deg" else 4) for key in keys[1:-1]}
    for key, numbers in matrices.items():
        fields[key].require(
            (numbers > 0.0).all() and (key != "degrees_of_freedom" or numbers.min() >= _LEAST_FREEDOM),
            f"numbers above {_LEAST_FREEDOM if key == 'degrees_of_freedom' else 0.0:g} are needed",
        )
    return Tails(
        frames=axes,
        scales=matrices["scales_mm_deg"] / units,
        freedom=matrices["degrees_of_freedom"],
        variances=(matrices["deviations_mm_deg"] / units) ** 2,
        limits=matrices["limits_mm_deg"] / units[[0, 2]],
        joined=fields["joined"].flag(),
    )


def _scenario(node: JsonNode, wanted: Scenario | None, folder: Path) -> Scenario:
    from apo_bench.scenario.file import load_scenario

    name = node.text()
    if wanted is not None:
        node.require(
            Path(name).stem == wanted.name,
            f'the scenario "{wanted.name}" was asked for',
            "give the file of that scenario, or ask for its own",
        )
        return wanted
    return load_scenario(folder / name if name.endswith(".toml") or "/" in name else name)


def _operations(
    node: JsonNode, assembly: Assembly, required: tuple[str, ...], optional: tuple[str, ...]
) -> list[Mapping[str, JsonNode]]:
    entries = [
        entry.fields(("operation", "part", *_POSE, *required), optional)
        for entry in node.items("operation", len(assembly))
    ]
    for k, (entry, operation) in enumerate(zip(entries, assembly.operations, strict=True)):
        entry["operation"].require(
            entry["operation"].integer() == k + 1,
            f"{k + 1} is needed",
            "the operations stand in order, numbered from 1",
        )
        entry["part"].require(
            entry["part"].text() == operation.main,
            f'"{operation.main}" is needed',
            "it is the part that this operation moves",
        )
    return entries


def _pose(fields: Mapping[str, JsonNode]) -> Array:
    position = fields["position_mm"].numbers(3)
    return pose.unpack(np.concatenate([position * 1e-3, fields["quaternion_wxyz"].quaternion()]))


def _poses(node: JsonNode, scenario: Scenario) -> Poses:
    parts = tuple(scenario.assembly.solids)
    for part in node.value if isinstance(node.value, dict) else ():
        require_known("part", part, parts, place=f"{node.file}, {node.key}")
    fields = node.fields(parts)
    return {part: _pose(fields[part].fields(_POSE)) for part in parts}


def _covariance(node: JsonNode, *, definite: bool = True) -> Array:
    C = node.numbers(6, 6)
    largest = float(np.abs(C).max())
    node.require(
        np.abs(C - C.T).max() <= 1e-9 * largest,
        "a symmetric 6 x 6 matrix is needed",
        "entry (i, j) must equal entry (j, i)",
    )
    lowest = float(np.linalg.eigvalsh((C + C.T) / 2)[0])
    node.require(
        not definite or lowest > 1e-15 * largest,
        "a positive definite 6 x 6 matrix is needed",
        "every variance must be above 0 and consistent",
    )
    node.require(
        definite or lowest >= -1e-9 * largest,
        "a positive semidefinite 6 x 6 matrix is needed",
        "no variance may be negative",
    )
    return (C + C.T) / 2 / np.outer(TO_MM_DEG, TO_MM_DEG)


def _stated(entry: Mapping[str, JsonNode], assumed: tuple[float, float] | None) -> Array:
    """The covariance of an operation, (6, 6) [m, rad], out of either way to state it, or of what is assumed."""
    by_deviation = [key for key in _DEVIATIONS if key in entry]
    if "covariance_mm_deg" in entry and not by_deviation:
        C = _covariance(entry["covariance_mm_deg"])
        if not is_sensible(C):
            node = entry["covariance_mm_deg"]
            raise InputError(
                f"{node.file}, {node.key}: the square root of a variance is out of range; {ALLOWED_DEVIATIONS}."
            )
        return C
    if "covariance_mm_deg" in entry or len(by_deviation) == 1 or not (by_deviation or assumed):
        node = entry["operation"]
        raise InputError(
            f"{node.file}, {node.key.removesuffix(', operation')}: state either 'covariance_mm_deg' or both "
            f"'deviation_mm' and 'deviation_deg', {_named(entry, by_deviation)} was given."
        )
    mm, deg = assumed or (0.0, 0.0)
    if by_deviation:
        mm = _deviation(entry["deviation_mm"], SHIFT_M, 1e-3)
        deg = _deviation(entry["deviation_deg"], TURN_RAD, np.pi / 180.0)
    return np.diag(np.array([mm] * 3 + [deg] * 3) / TO_MM_DEG) ** 2


def _deviation(node: JsonNode, limits: tuple[float, float], unit: float) -> float:
    x = node.number(0.0, above=True)
    node.require(
        is_within(x * unit, limits), f"a standard deviation from {limits[0] / unit:g} to {limits[1] / unit:g} is needed"
    )
    return x


def _named(entry: Mapping[str, JsonNode], by_deviation: list[str]) -> str:
    keys = [key for key in ("covariance_mm_deg", *by_deviation) if key in entry]
    return " with ".join(f"'{key}'" for key in keys) or "neither"


def _step(node: JsonNode, goals: Array) -> tuple[Step, Array]:
    """A step of the schedule and its target, which is the goal of its operation if none is stated."""
    stated = isinstance(node.value, dict) and any(key in node.value for key in _POSE)
    fields = node.fields(("operation", *_POSE) if stated else ("operation",), ("undo",) if stated else ("undo", *_POSE))
    number = fields["operation"].integer()
    fields["operation"].require(1 <= number <= len(goals), f"an operation from 1 to {len(goals)} is needed")
    step = Step(number - 1, fields["undo"].flag() if "undo" in fields else False)
    return step, _pose(fields) if stated else goals[step.operation]
