"""Observations and plans from their JSON forms, which `json_forms` describes."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import UNSET, UnsetType

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
from apo_bench.errors import InputError, require, require_known
from apo_bench.formats.deviations import is_sensible
from apo_bench.formats.json_forms import (
    OUTLIER_KEYS,
    TO_MM_DEG,
    Matrix,
    ObservationForm,
    ObservedOperation,
    PlanForm,
    PlannedOperation,
    PoseForm,
    SharedForm,
    StepForm,
    TailsForm,
)
from apo_bench.geometry import Array
from apo_bench.io import convert_typed, read_typed
from apo_bench.scenario import Scenario, layout_at


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
    file = str(path)
    form = read_typed(path, ObservationForm, "observation", syntax="json")
    loaded = _scenario(file, form.scenario, scenario)
    assembly = loaded.assembly
    _check_operations(file, form.operations, assembly)
    own_start = layout_at(loaded, 0.0, 0.0, 0.0, clearance_mm=loaded.clearance_mm).start
    observation = Observation(
        assembly=assembly,
        start=own_start if form.start is UNSET else _poses(file, form.start, assembly),
        poses=_goals(file, form.operations),
        covariance=np.array([_stated(file, entry, assumed) for entry in form.operations]).reshape(-1, 6, 6),
        observed=np.array([entry.seen for entry in form.operations]),
        gap_m=(loaded.gap_mm if form.gap_mm is UNSET else form.gap_mm) * 1e-3,
        play_m=(loaded.clearance_mm if form.play_mm is UNSET else form.play_mm) * 1e-3,
        outliers=None if form.outliers is UNSET else _outliers(file, form.outliers),
        shared=tuple(_shared(file, error, len(assembly)) for error in form.shared),
        tails=None if form.tails is UNSET else _tails(file, form.tails, len(assembly)),
    )
    complete = all(entry.covariance_mm_deg is not UNSET or entry.deviation_mm is not UNSET for entry in form.operations)
    return observation, not complete


def read_plan(path: str | Path, scenario: Scenario | None = None) -> Plan:
    """A plan from its file; see `read_json_observation` for `scenario` and errors."""
    file = str(path)
    form = read_typed(path, PlanForm, "plan", syntax="json")
    assembly = _scenario(file, form.scenario, scenario).assembly
    _check_operations(file, form.operations, assembly)
    goals = _goals(file, form.operations)
    for step in form.schedule:
        require(step.operation <= len(goals), f"{file}, schedule: an operation from 1 to {len(goals)} is needed.")
    schedule = tuple(Step(step.operation - 1, step.undo) for step in form.schedule)
    fault = schedule_fault(schedule, len(goals)) if schedule else None
    require(not fault, f"{file}, schedule: it {fault}; {SCHEDULE_REMEDY}.")
    targets = np.array([_target(file, step, goals) for step in form.schedule] or goals)
    return Plan(assembly, _poses(file, form.start, assembly), goals, schedule, targets)


def _scenario(file: str, name: str, wanted: Scenario | None) -> Scenario:
    from apo_bench.scenario.file import load_scenario

    if wanted is None:
        return load_scenario(Path(file).parent / name if name.endswith(".toml") or "/" in name else name)
    require(
        Path(name).stem == wanted.name,
        f'{file}, scenario: the scenario "{wanted.name}" was asked for, the file is of "{name}".',
    )
    return wanted


def _check_operations(file: str, entries: Sequence[PlannedOperation], assembly: Assembly) -> None:
    """Every operation stands once, in order, with the part that it moves."""
    require(
        len(entries) == len(assembly),
        f"{file}, operations: {len(assembly)} entries are needed, {len(entries)} were given.",
    )
    for k, (entry, operation) in enumerate(zip(entries, assembly.operations, strict=True), start=1):
        require(entry.operation == k, f"{file}, operation {k}, operation: {k} is needed, they stand in order.")
        require(
            entry.part == operation.main,
            f'{file}, operation {k}, part: "{operation.main}" is needed, the part that this operation moves.',
        )


def _goals(file: str, entries: Sequence[PlannedOperation]) -> Array:
    return np.array([e.matrix(f"{file}, operation {e.operation}") for e in entries]).reshape(-1, 4, 4)


def _poses(file: str, forms: dict[str, PoseForm], assembly: Assembly) -> Poses:
    for part in forms:
        require_known("part", part, tuple(assembly.solids), place=f"{file}, start")
    for part in assembly.solids:
        require(part in forms, f"{file}, start: the key '{part}' is missing.")
    return {part: forms[part].matrix(f"{file}, start, {part}") for part in assembly.solids}


def _target(file: str, step: StepForm, goals: Array) -> Array:
    """Where a step of the schedule leads: the goal of its operation if it states nothing else."""
    place = f"{file}, schedule, operation {step.operation}"
    if step.position_mm is UNSET and step.quaternion_wxyz is UNSET:
        return np.asarray(goals[step.operation - 1])
    if isinstance(step.position_mm, UnsetType) or isinstance(step.quaternion_wxyz, UnsetType):
        raise InputError(f"{place}: position_mm and quaternion_wxyz are needed together, or none of them.")
    return PoseForm(position_mm=step.position_mm, quaternion_wxyz=step.quaternion_wxyz).matrix(place)


def _outliers(file: str, form: Mapping[str, Any]) -> OutlierModel:
    """How often observations are worse than they state."""
    for key in form:
        require_known("key", key, (*OUTLIER_KEYS, "camera_mm"), place=f"{file}, outliers")
    rates = {OUTLIER_KEYS[key]: value for key, value in form.items() if key in OUTLIER_KEYS}
    if "camera_mm" in form:
        rates["camera_m"] = [
            x * 1e-3 for x in convert_typed(form["camera_mm"], list[float], f"{file}, outliers, camera_mm")
        ]
    return convert_typed(rates, OutlierModel, f"{file}, outliers")


def _shared(file: str, form: SharedForm, n: int) -> SharedError:
    """An error that operations share."""
    place = f"{file}, shared, {form.name}"
    m = len(form.operations)
    once = len(set(form.operations)) == m > 0 and max(form.operations) <= n
    require(once, f"{place}, operations: operations from 1 to {n}, each once, are needed.")
    require(form.local is UNSET or form.frame is not UNSET, f"{place}, local: state the frame, or leave this out.")
    return SharedError(
        name=form.name,
        operations=tuple(k - 1 for k in form.operations),
        covariance=_covariance(form.covariance_mm_deg, f"{place}, covariance_mm_deg", definite=False),
        frame=None if isinstance(form.frame, UnsetType) else form.frame.matrix(f"{place}, frame"),
        local=form.local is True,
        correlation=None if form.correlation is UNSET else _correlation(form.correlation, m, f"{place}, correlation"),
    )


def _correlation(rows: list[list[float]], m: int, place: str) -> Array:
    """A correlation matrix, (m, m)."""
    square = [len(row) for row in rows] == [m] * m
    correlation = np.array(rows if square else np.zeros((m, m)), dtype=np.float64)
    holds = np.abs(correlation - correlation.T).max() <= 1e-9 and np.abs(np.diag(correlation) - 1.0).max() <= 1e-9
    require(holds, f"{place}: a symmetric {m} x {m} matrix with 1 on its diagonal is needed.")
    return correlation


def _tails(file: str, form: TailsForm, n: int) -> Tails:
    """How errors are distributed."""
    units = TO_MM_DEG[[0, 0, 3, 3]]
    axes = np.array(form.axes, dtype=np.float64).reshape(-1, 3, 3)
    rotations = np.abs(axes @ np.swapaxes(axes, 1, 2) - np.eye(3)).max(initial=0.0) <= 1e-6
    require(len(axes) == n and rotations, f"{file}, tails, axes: a rotation matrix for each operation is needed.")
    return Tails(
        frames=axes,
        scales=np.array(form.scales_mm_deg) / units,
        freedom=np.array(form.degrees_of_freedom),
        variances=(np.array(form.deviations_mm_deg) / units) ** 2,
        limits=np.array(form.limits_mm_deg) / units[[0, 2]],
        joined=form.joined,
    )


def _covariance(rows: Matrix, place: str, *, definite: bool = True) -> Array:
    """A covariance (6, 6), [m, rad], from one in mm and degrees."""
    C = np.array(rows)
    largest = float(np.abs(C).max())
    lowest = float(np.linalg.eigvalsh((C + C.T) / 2)[0])
    positive = lowest > 1e-15 * largest if definite else lowest >= -1e-9 * largest
    require(np.abs(C - C.T).max() <= 1e-9 * largest, f"{place}: a symmetric 6 x 6 matrix is needed.")
    require(positive, f"{place}: a positive {'definite' if definite else 'semidefinite'} 6 x 6 matrix is needed.")
    return (C + C.T) / 2 / np.outer(TO_MM_DEG, TO_MM_DEG)


def _stated(file: str, entry: ObservedOperation, assumed: tuple[float, float] | None) -> Array:
    """The covariance of an operation, (6, 6) [m, rad], out of either way to state it, or of what is assumed."""
    place = f"{file}, operation {entry.operation}"
    mm, deg = assumed or (None, None)
    if entry.deviation_mm is not UNSET or entry.deviation_deg is not UNSET:
        mm = entry.deviation_mm or None
        deg = entry.deviation_deg or None
    if entry.covariance_mm_deg is not UNSET:
        C = _covariance(entry.covariance_mm_deg, f"{place}, covariance_mm_deg")
        require(is_sensible(C), f"{place}, covariance_mm_deg: the square root of a variance is out of range.")
        return C
    require(
        mm is not None and deg is not None,
        f"{place}: state either 'covariance_mm_deg' or both 'deviation_mm' and 'deviation_deg'.",
    )
    return np.diag(np.array([mm] * 3 + [deg] * 3) / TO_MM_DEG) ** 2
