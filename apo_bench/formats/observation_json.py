"""Read and write the JSON form of an observation.

A file names its scenario, which defines parts, operations and contacts; the file itself holds only numbers.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import UNSET, Meta, UnsetType

from apo_bench.assembly import Assembly, Observation, OutlierModel, Poses, SharedError, Tails
from apo_bench.errors import require, require_known
from apo_bench.formats.deviations import is_sensible
from apo_bench.formats.json_forms import (
    TO_MM_DEG,
    Form,
    Number,
    PlannedOperation,
    PoseForm,
    Position,
    make_covariance_form,
    make_pose_form,
)
from apo_bench.geometry import Array
from apo_bench.io import FileTable, Finite, NotNegative, Positive, Text, Triple, convert_typed, read_typed
from apo_bench.scenario import Scenario, place_layout

OBSERVATION_SCHEMA = "apo-bench/observation/2"
_LEAST_FREEDOM = 0.4  # least degrees of freedom of Student's t
_TAIL_UNITS = TO_MM_DEG[[0, 0, 3, 3]]  # factors to mm, mm, deg, deg: across the ray, along it, tilt, turn
_Row = tuple[Finite, Finite, Finite, Finite, Finite, Finite]  # a row of a covariance
_Matrix = tuple[_Row, _Row, _Row, _Row, _Row, _Row]
_Freedom = Annotated[float, Meta(ge=_LEAST_FREEDOM, le=1e300)]
_RATES: Mapping[str, str] = {
    "gross_rate": "gross",
    "broad_rate": "broad",
    "broad_times": "times",
    "wrong_relation_rate": "relation",
    "turned_share": "flip",
    "stale_share": "stale",
    "swapped_share": "swap",
    "shifted_share": "shift",
    "displaced_view_rate": "view",
    "repeat_rate": "repeat",
}
"""Key of the form -> field of `OutlierModel`."""


class ObservedOperation(PlannedOperation, frozen=True, kw_only=True):
    """An observed operation; standard deviations along and about each axis may stand in for a covariance."""

    covariance_mm_deg: _Matrix | UnsetType = UNSET
    seen: bool = True
    deviation_mm: Annotated[float, Meta(ge=1e-4, le=1e4)] | UnsetType = UNSET
    deviation_deg: Annotated[float, Meta(ge=1e-4, le=180.0)] | UnsetType = UNSET


class SharedForm(FileTable, frozen=True, kw_only=True):
    """An error that several operations share; without a frame its twist is in the frame of each part."""

    name: Text
    operations: list[Number]
    covariance_mm_deg: _Matrix
    frame: PoseForm | UnsetType = UNSET
    local: bool | UnsetType = UNSET
    correlation: list[list[Finite]] | UnsetType = UNSET


class TailsForm(FileTable, frozen=True, kw_only=True):
    """The distribution of errors; lists of four are across the ray, along it, tilt, and turn about it."""

    axes: list[tuple[Triple, Triple, Triple]]
    scales_mm_deg: tuple[Positive, Positive, Positive, Positive]
    degrees_of_freedom: tuple[_Freedom, _Freedom, _Freedom, _Freedom]
    deviations_mm_deg: tuple[Positive, Positive, Positive, Positive]
    limits_mm_deg: tuple[Positive, Positive]
    joined: bool


OutliersForm = msgspec.defstruct(
    "OutliersForm",
    [*((key, float, UNSET) for key in _RATES), ("camera_mm", Position, UNSET)],
    bases=(FileTable,),
    kw_only=True,
)
"""Rates and sizes of gross errors; missing keys mean the defaults of `OutlierModel`."""


class ObservationForm(FileTable, frozen=True, kw_only=True):
    """The whole form; missing `start`, `gap_mm` and `play_mm` are those of the scenario."""

    schema: Literal["apo-bench/observation/2"]
    scenario: Text
    start: dict[str, PoseForm] | UnsetType = UNSET
    gap_mm: Positive | UnsetType = UNSET
    play_mm: NotNegative | UnsetType = UNSET
    operations: list[ObservedOperation]
    outliers: OutliersForm | UnsetType = UNSET  # type: ignore[valid-type]
    shared: tuple[SharedForm, ...] = ()
    tails: TailsForm | UnsetType = UNSET


def make_observation_form(observation: Observation, scenario: str) -> Form:
    """Return the JSON form of an observation.

    Args:
        scenario: Name or file of the scenario.
    """
    observed = [
        ObservedOperation(
            operation=k + 1,
            part=operation.main,
            **make_pose_form(observation.poses[k]),
            covariance_mm_deg=make_covariance_form(observation.covariance[k]),
            seen=bool(observation.observed[k]),
        )
        for k, operation in enumerate(observation.assembly.operations)
    ]
    form = ObservationForm(
        schema="apo-bench/observation/2",
        scenario=scenario,
        start={part: PoseForm(**make_pose_form(T)) for part, T in observation.start.items()},
        gap_mm=observation.gap_m * 1e3,
        play_mm=observation.play_m * 1e3,
        operations=observed,
        outliers=UNSET if observation.outliers is None else _make_outliers_form(observation.outliers),
        shared=tuple(map(_make_shared_form, observation.shared)),
        tails=UNSET if observation.tails is None else _make_tails_form(observation.tails),
    )
    return dict(msgspec.to_builtins(form))


def _make_outliers_form(outliers: OutlierModel) -> Any:
    """Return the form of an outlier model."""
    camera = UNSET if outliers.camera_m is None else tuple(1e3 * x for x in outliers.camera_m)
    return OutliersForm(**{key: getattr(outliers, name) for key, name in _RATES.items()}, camera_mm=camera)


def _make_shared_form(error: SharedError) -> SharedForm:
    """Return the form of a shared error, with operations counted from 1."""
    return SharedForm(
        name=error.name,
        operations=[k + 1 for k in error.operations],
        covariance_mm_deg=make_covariance_form(error.covariance),
        frame=UNSET if error.frame is None else PoseForm(**make_pose_form(error.frame)),
        local=UNSET if error.frame is None else error.local,
        correlation=UNSET if error.correlation is None else error.correlation.tolist(),
    )


def _make_tails_form(tails: Tails) -> TailsForm:
    """Return the form of an error distribution."""
    return TailsForm(
        axes=[frame.tolist() for frame in tails.frames],
        scales_mm_deg=(tails.scales * _TAIL_UNITS).tolist(),
        degrees_of_freedom=tails.freedom.tolist(),
        deviations_mm_deg=(np.sqrt(tails.variances) * _TAIL_UNITS).tolist(),
        limits_mm_deg=(tails.limits * _TAIL_UNITS[[0, 2]]).tolist(),  # the limits of lengths and of angles
        joined=tails.joined,
    )


def read_json_observation(
    path: str | Path, scenario: Scenario, assumed: tuple[float, float]
) -> tuple[Observation, bool]:
    """Read an observation from its JSON form.

    Optional: `start` and `gap_mm` (default: the scenario's), `play_mm` (default: the scenario's `clearance_mm`),
    `outliers` (default: unknown) and `seen` (default: true). Instead of `covariance_mm_deg`, `deviation_mm` and
    `deviation_deg` state one standard deviation along and one about the three axes.

    Args:
        assumed: Standard deviations, in mm and degrees, of operations that state none.

    Returns:
        The observation, and whether a standard deviation had to be assumed.

    Raises:
        InputError: The file deviates from the form; the message names file and key.
    """
    file = str(path)
    form = read_typed(path, ObservationForm, "observation", syntax="json")
    assembly = scenario.assembly
    require(
        Path(form.scenario).stem == scenario.name,
        f"{file}, scenario: the file is of '{form.scenario}', not of '{scenario.name}'; give a file of that scenario.",
    )
    _check_operations(file, form.operations, assembly)
    usual_start = place_layout(scenario, 0.0, 0.0, 0.0, clearance_mm=scenario.clearance_mm).start
    poses = [entry.matrix(f"{file}, operation {entry.operation}") for entry in form.operations]
    observation = Observation(
        assembly=assembly,
        start=usual_start if isinstance(form.start, UnsetType) else _read_start(file, form.start, assembly),
        poses=np.array(poses).reshape(-1, 4, 4),
        covariance=np.array([_read_stated_covariance(file, entry, assumed) for entry in form.operations]).reshape(
            -1, 6, 6
        ),
        observed=np.array([entry.seen for entry in form.operations]),
        gap_m=(scenario.gap_mm if form.gap_mm is UNSET else form.gap_mm) * 1e-3,
        play_m=(scenario.clearance_mm if form.play_mm is UNSET else form.play_mm) * 1e-3,
        outliers=None if form.outliers is UNSET else _read_outliers(file, form.outliers),
        shared=tuple(_read_shared_error(file, error, len(assembly)) for error in form.shared),
        tails=None if isinstance(form.tails, UnsetType) else _read_tails(file, form.tails, len(assembly)),
    )
    # No covariance and no deviations.
    return observation, any(entry.covariance_mm_deg is UNSET is entry.deviation_mm for entry in form.operations)


def _check_operations(file: str, entries: Sequence[PlannedOperation], assembly: Assembly) -> None:
    """Check that every operation is listed once, in order, with the part that it moves."""
    stated = [(entry.operation, entry.part) for entry in entries]
    needed = [(k, operation.main) for k, operation in enumerate(assembly.operations, start=1)]
    require(len(stated) == len(needed), f"{file}, operations: {len(needed)} entries are needed, not {len(stated)}.")
    for (k, part), (number, main) in zip(stated, needed, strict=True):
        require(
            (k, part) == (number, main),
            f"{file}, operation {number}: operation {k} of '{part}' stands here; state operation {number} of '{main}'.",
        )


def _read_start(file: str, forms: Mapping[str, PoseForm], assembly: Assembly) -> Poses:
    """Return the start of every part of the scenario, world, [m]."""
    for part in forms:
        require_known("part", part, tuple(assembly.solids), place=f"{file}, start")
    for part in assembly.solids:
        require(part in forms, f"{file}, start: the key '{part}' is missing.")
    return {part: forms[part].matrix(f"{file}, start, {part}") for part in assembly.solids}


def _read_outliers(file: str, form: Any) -> OutlierModel:
    """Return the outlier model that a form states."""
    stated = {key: value for key, value in msgspec.structs.asdict(form).items() if value is not UNSET}
    camera = {"camera_m": [1e-3 * x for x in stated.pop("camera_mm")]} if "camera_mm" in stated else {}
    return convert_typed({_RATES[key]: x for key, x in stated.items()} | camera, OutlierModel, f"{file}, outliers")


def _read_shared_error(file: str, form: SharedForm, n: int) -> SharedError:
    """Return a shared error with operations counted from 0.

    Args:
        n: Number of operations.
    """
    place = f"{file}, shared, {form.name}"
    m = len(form.operations)
    once = len(set(form.operations)) == m > 0 and max(form.operations) <= n  # no duplicates, at least one
    require(once, f"{place}, operations: operations from 1 to {n}, each once, are needed.")
    require(form.local is UNSET or form.frame is not UNSET, f"{place}, local: state the frame, or leave this out.")
    return SharedError(
        name=form.name,
        operations=tuple(k - 1 for k in form.operations),
        covariance=_read_covariance(form.covariance_mm_deg, f"{place}, covariance_mm_deg", definite=False),
        frame=None if isinstance(form.frame, UnsetType) else form.frame.matrix(f"{place}, frame"),
        local=form.local is True,
        correlation=None
        if form.correlation is UNSET
        else _read_correlation(form.correlation, m, f"{place}, correlation"),
    )


def _read_correlation(rows: list[list[float]], m: int, place: str) -> Array:
    """Return a correlation matrix, (m, m), after checking its size, symmetry and diagonal."""
    square = [len(row) for row in rows] == [m] * m
    correlation = np.array(rows if square else np.zeros((m, m)), dtype=np.float64)
    holds = np.abs(correlation - correlation.T).max() <= 1e-9 and np.abs(np.diag(correlation) - 1.0).max() <= 1e-9
    require(holds, f"{place}: a symmetric {m} x {m} matrix with 1 on its diagonal is needed.")
    return correlation


def _read_tails(file: str, form: TailsForm, n: int) -> Tails:
    """Return the error distribution of n operations that a form states."""
    axes = np.array(form.axes, dtype=np.float64).reshape(-1, 3, 3)
    rotations = np.abs(axes @ np.swapaxes(axes, 1, 2) - np.eye(3)).max(initial=0.0) <= 1e-6
    require(len(axes) == n and rotations, f"{file}, tails, axes: a rotation matrix for each operation is needed.")
    return Tails(
        frames=axes,
        scales=np.array(form.scales_mm_deg) / _TAIL_UNITS,
        freedom=np.array(form.degrees_of_freedom),
        variances=(np.array(form.deviations_mm_deg) / _TAIL_UNITS) ** 2,
        limits=np.array(form.limits_mm_deg) / _TAIL_UNITS[[0, 2]],
        joined=form.joined,
    )


def _read_covariance(rows: _Matrix, place: str, *, definite: bool = True) -> Array:
    """Return a covariance (6, 6), [m, rad], from one in mm and degrees.

    Args:
        definite: Whether it must be positive definite; otherwise semidefinite.
    """
    C = np.array(rows)
    largest = float(np.abs(C).max())
    lowest = float(np.linalg.eigvalsh((C + C.T) / 2)[0])
    positive = lowest > 1e-15 * largest if definite else lowest >= -1e-9 * largest
    require(np.abs(C - C.T).max() <= 1e-9 * largest, f"{place}: a symmetric 6 x 6 matrix is needed.")
    require(positive, f"{place}: a positive {'definite' if definite else 'semidefinite'} 6 x 6 matrix is needed.")
    return (C + C.T) / 2 / np.outer(TO_MM_DEG, TO_MM_DEG)


def _read_stated_covariance(file: str, entry: ObservedOperation, assumed: tuple[float, float]) -> Array:
    """Return the covariance of an operation, (6, 6), [m, rad]: as stated, from standard deviations, or as assumed.

    Args:
        assumed: Standard deviations in mm and degrees.
    """
    place = f"{file}, operation {entry.operation}"
    if not isinstance(entry.covariance_mm_deg, UnsetType):
        C = _read_covariance(entry.covariance_mm_deg, f"{place}, covariance_mm_deg")
        require(is_sensible(C), f"{place}, covariance_mm_deg: the square root of a variance is out of range.")
        return C
    mm, deg = entry.deviation_mm, entry.deviation_deg
    require((mm is UNSET) == (deg is UNSET), f"{place}: state both 'deviation_mm' and 'deviation_deg', or neither.")
    # Either both are stated or none.
    mm, deg = assumed if isinstance(mm, UnsetType) or isinstance(deg, UnsetType) else (mm, deg)
    return np.diag(np.array([mm] * 3 + [deg] * 3) / TO_MM_DEG) ** 2
