"""The JSON forms of an observation and a plan: one each, versioned, in mm and degrees.

A file names its scenario, which carries the topology; the file itself carries numbers only. A pose is
`position_mm` [x, y, z] and `quaternion_wxyz` [w, x, y, z] in the world frame. Operations are numbered from 1.
A covariance is that of the body twist (x, y, z, rx, ry, rz) in mm and degrees.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import UNSET, Meta, UnsetType

from apo_bench.assembly import Observation, OutlierModel, Plan, Poses, SharedError, Tails
from apo_bench.geometry import FARTHEST_M, Array, pose
from apo_bench.io import Finite, NotNegative, Positive, Quadruple, Table, Text, Triple, check_quaternion, write_file

OBSERVATION_SCHEMA = "apo-bench/observation/2"
PLAN_SCHEMA = "apo-bench/plan/2"
TO_MM_DEG = np.array([1e3] * 3 + [180.0 / np.pi] * 3)
LEAST_FREEDOM = 0.4
_FARTHEST_MM = 1e3 * FARTHEST_M
Coordinate = Annotated[float, Meta(ge=-_FARTHEST_MM, le=_FARTHEST_MM)]
Position = tuple[Coordinate, Coordinate, Coordinate]
Number = Annotated[int, Meta(ge=1)]
"""Of an operation, counted from 1."""
TrialRecord = tuple[Finite, Finite, Finite, Finite, Finite, Finite]
Matrix = tuple[TrialRecord, TrialRecord, TrialRecord, TrialRecord, TrialRecord, TrialRecord]
DeviationMm = Annotated[float, Meta(ge=1e-4, le=1e4)]
DeviationDeg = Annotated[float, Meta(ge=1e-4, le=180.0)]
Freedom = Annotated[float, Meta(ge=LEAST_FREEDOM, le=1e300)]
Form = dict[str, Any]
"""What `json` can write."""


class PoseForm(Table, frozen=True, kw_only=True):
    """A pose in the world."""

    position_mm: Position
    quaternion_wxyz: Quadruple

    def matrix(self, place: str) -> Array:
        """Return the pose, (4, 4), [m].

        Args:
            place: File and key, for the message.

        Raises:
            InputError: The quaternion is not of length 1.
        """
        q = check_quaternion(self.quaternion_wxyz, f"{place}, quaternion_wxyz")
        return pose.unpack(np.concatenate([np.array(self.position_mm) * 1e-3, q]))


class PlannedOperation(PoseForm, frozen=True, kw_only=True):
    """The target pose of an operation."""

    operation: Number
    part: Text


class ObservedOperation(PlannedOperation, frozen=True, kw_only=True):
    """What was observed of an operation; instead of a covariance, one deviation for directions and one for turns."""

    covariance_mm_deg: Matrix | UnsetType = UNSET
    seen: bool = True
    deviation_mm: DeviationMm | UnsetType = UNSET
    deviation_deg: DeviationDeg | UnsetType = UNSET


OUTLIER_KEYS: Mapping[str, str] = {
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
"""Key of a form -> field of `OutlierModel`."""


class SharedForm(Table, frozen=True, kw_only=True):
    """An error that operations share; without a frame its twist is in the frame of each part."""

    name: Text
    operations: list[Number]
    covariance_mm_deg: Matrix
    frame: PoseForm | UnsetType = UNSET
    local: bool | UnsetType = UNSET
    correlation: list[list[Finite]] | UnsetType = UNSET


class TailsForm(Table, frozen=True, kw_only=True):
    """How errors are distributed: four numbers each, across and along the ray, tilt and turn about it."""

    axes: list[tuple[Triple, Triple, Triple]]
    scales_mm_deg: tuple[Positive, Positive, Positive, Positive]
    degrees_of_freedom: tuple[Freedom, Freedom, Freedom, Freedom]
    deviations_mm_deg: tuple[Positive, Positive, Positive, Positive]
    limits_mm_deg: tuple[Positive, Positive]
    joined: bool


class ObservationForm(Table, frozen=True, kw_only=True):
    """An observation; what is left out of `start`, `gap_mm` and `play_mm` is as in its scenario."""

    schema: Literal["apo-bench/observation/2"]
    scenario: Text
    start: dict[str, PoseForm] | UnsetType = UNSET
    gap_mm: Positive | UnsetType = UNSET
    play_mm: NotNegative | UnsetType = UNSET
    operations: list[ObservedOperation]
    outliers: dict[str, Any] | UnsetType = UNSET
    """The keys of `OUTLIER_KEYS`, and `camera_mm`; what is left out is as usual."""
    shared: tuple[SharedForm, ...] = ()
    tails: TailsForm | UnsetType = UNSET


class StepForm(Table, frozen=True, kw_only=True):
    """A step of a schedule; it has a pose where that is not the goal of its operation."""

    operation: Number
    undo: bool = False
    position_mm: Position | UnsetType = UNSET
    quaternion_wxyz: Quadruple | UnsetType = UNSET


class PlanForm(Table, frozen=True, kw_only=True):
    """A plan."""

    schema: Literal["apo-bench/plan/2"]
    scenario: Text
    start: dict[str, PoseForm]
    operations: list[PlannedOperation]
    schedule: list[StepForm]


def observation_form(observation: Observation, scenario: str) -> Form:
    """The JSON form of an observation."""
    operations = observation.assembly.operations
    observed = [
        ObservedOperation(
            operation=k + 1,
            part=operation.main,
            **pose_form(observation.poses[k]),
            covariance_mm_deg=covariance_form(observation.covariance[k]),
            seen=bool(observation.observed[k]),
        )
        for k, operation in enumerate(operations)
    ]
    form = ObservationForm(
        schema="apo-bench/observation/2",
        scenario=scenario,
        start=_start_form(observation.start),
        gap_mm=observation.gap_m * 1e3,
        play_mm=observation.play_m * 1e3,
        operations=observed,
        outliers=UNSET if observation.outliers is None else _outliers_form(observation.outliers),
        shared=tuple(map(_shared_form, observation.shared)),
        tails=UNSET if observation.tails is None else _tails_form(observation.tails),
    )
    return dict(msgspec.to_builtins(form))


def plan_form(plan: Plan, scenario: str) -> Form:
    """The JSON form of a plan."""
    planned = [
        PlannedOperation(operation=k + 1, part=operation.main, **pose_form(plan.target_poses[k]))
        for k, operation in enumerate(plan.assembly.operations)
    ]
    schedule = []
    for step, target in zip(plan.schedule, plan.step_poses, strict=True):
        own = {} if np.array_equal(target, plan.target_poses[step.operation]) else pose_form(target)
        schedule.append(StepForm(operation=step.operation + 1, undo=step.undo, **own))
    form = PlanForm(
        schema="apo-bench/plan/2",
        scenario=scenario,
        start=_start_form(plan.start),
        operations=planned,
        schedule=schedule,
    )
    return dict(msgspec.to_builtins(form))


def write_form(form: Form, path: str | Path) -> None:
    """Write a form as UTF-8 JSON.

    Raises:
        InputError: The file cannot be written.
    """
    write_file(path, json.dumps(form, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def pose_form(T: Array) -> Form:
    """A pose (4, 4), [m], in mm and as a quaternion."""
    packed = pose.pack(T)
    return {"position_mm": (packed[:3] * 1e3).tolist(), "quaternion_wxyz": packed[3:].tolist()}


def covariance_form(C: Array) -> Any:
    """A covariance (6, 6), [m, rad], in mm and degrees, as lists."""
    return (C * np.outer(TO_MM_DEG, TO_MM_DEG)).tolist()


def _start_form(start: Poses) -> dict[str, PoseForm]:
    return {part: PoseForm(**pose_form(T)) for part, T in start.items()}


def _outliers_form(outliers: OutlierModel) -> Form:
    camera = {} if outliers.camera_m is None else {"camera_mm": [1e3 * x for x in outliers.camera_m]}
    return {key: getattr(outliers, name) for key, name in OUTLIER_KEYS.items()} | camera


def _shared_form(error: SharedError) -> SharedForm:
    return SharedForm(
        name=error.name,
        operations=[k + 1 for k in error.operations],
        covariance_mm_deg=covariance_form(error.covariance),
        frame=UNSET if error.frame is None else PoseForm(**pose_form(error.frame)),
        local=UNSET if error.frame is None else error.local,
        correlation=UNSET if error.correlation is None else error.correlation.tolist(),
    )


def _tails_form(tails: Tails) -> TailsForm:
    units = TO_MM_DEG[[0, 0, 3, 3]]
    return TailsForm(
        axes=[frame.tolist() for frame in tails.frames],
        scales_mm_deg=(tails.scales * units).tolist(),
        degrees_of_freedom=tails.freedom.tolist(),
        deviations_mm_deg=(np.sqrt(tails.variances) * units).tolist(),
        limits_mm_deg=(tails.limits * units[[0, 2]]).tolist(),
        joined=tails.joined,
    )
