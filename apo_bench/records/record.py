"""The record of a trial: one line of `trials.jsonl`.

Lengths are in mm, angles in degrees, quaternions are wxyz, operations are numbered from 1. Records are checked by these
types when they are written and read: finite numbers in their range, and no other columns. The trials of one sweep
differ in the columns `KEY`.
"""

from collections.abc import Iterator, Mapping
from operator import itemgetter
from types import MappingProxyType
from typing import Annotated, Any, Literal, NotRequired, TypedDict, get_type_hints

from msgspec import Meta

from apo_bench.records.outcomes import CODES, STAGES
from apo_bench.records.settings import LARGEST_SEED, SETTINGS, Name, TrialConfig

LONGEST_SENTENCE = 1000
LARGEST_NUMBER = 1e15
"""Of a number that physics or a solver gave; beyond, sums and pictures of it say nothing."""
_Number = Annotated[float, Meta(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
_Size = Annotated[float, Meta(ge=0.0, le=LARGEST_NUMBER)]
_Share = Annotated[float, Meta(ge=0.0, le=1.0)]
_Count = Annotated[int, Meta(ge=0, le=1_000_000)]
_Operation = Annotated[int, Meta(ge=1, le=100_000)]
_Pose = Annotated[list[_Number], Meta(min_length=7, max_length=7)]


class FreedSet(TypedDict):
    """A set of operations that were freed, and the gap that was left [mm]."""

    step: _Operation
    free: list[_Operation]
    gap_mm: _Number | None


class FreeMoved(TypedDict):
    """An operation, and how far its goal was moved, [mm] and [deg]."""

    operation: _Operation
    mm: _Size
    deg: _Size


class GraspSlip(TypedDict):
    """An operation, and how far its part moved in the hand after the grasp, [mm] and [deg]."""

    operation: _Operation
    carried_mm: _Size
    carried_deg: _Size
    """When its last motion, to its place, began."""
    mm: _Size
    deg: _Size
    """When it was let go of, or the replay failed."""


class FailurePrediction(TypedDict):
    """The prediction of failure, and how far off the plan is then [mm]."""

    fails: bool
    operation: _Operation | None
    code: Literal[
        "ok",
        "residual",
        "interference",
        "unstable_goal",
        "unreachable_start",
        "unreachable",
        "gripper_room",
        "tip_error",
    ]
    size_mm: NotRequired[_Number | None]
    sentence: NotRequired[str]
    """Of what the arm cannot do."""


class _Columns(TypedDict, total=False):
    """Columns before the results whose names stand in the code; the columns of all settings are in `RECORD_FIELDS`."""

    schema: str
    env_id: str
    config_hash: str
    scenario: str
    noise_mm: float | None
    noise_deg: float | None
    human_error_scale: float | None
    clearance_mm: float
    pose_source: str
    noise: str
    grasp: str
    arm: str
    contact_source: str
    method: str
    seed: int
    secret_seed: str | None


_COLUMNS = frozenset(get_type_hints(_Columns))


class TrialRecord(_Columns, total=False):
    """A complete record has all of these, in this order; the record of a part of a trial has some of them."""

    thresholds: dict[str, _Size] | None
    """What the judge demands: lengths in mm, angles in degrees."""
    demonstration: str | None
    """How the human's own assembly ended: `ok` or a code."""
    success: bool | None
    """Whether the finished assembly is right; null if the demonstration itself was not, so that the trial does not
    count."""
    as_demonstrated: bool | None
    """Whether every contact was also made when and where it was demonstrated."""
    loose_success: bool | None
    """Success with the loose thresholds, 5 mm and 5 degrees."""
    failure_stage: str | None
    """Stage at which a trial failed that was no success."""
    failure_code: str | None
    """Code of why a trial failed that was no success."""
    failure_operation: _Operation | None
    """Operation in which a trial failed, if it is known."""
    sentence: str | None
    """How the trial ended, for a person."""
    as_demonstrated_code: str | None
    """Code of why a trial is not as demonstrated."""
    conditions: dict[str, bool] | None
    """The conditions of success, each by itself."""
    worst_gap_mm: _Number | None
    """Largest gap, or depth, of faces that should touch [mm]."""
    worst_angle_deg: _Number | None
    """Largest angle between faces that should touch [deg]."""
    least_overlap: _Number | None
    """Smallest overlap of faces that should touch, as a part of the true overlap."""
    penetration_mm: _Number | None
    """Largest depth of one part in another [mm]."""
    placed_part_shift_mm: _Number | None
    """Largest distance by which a part that was in place was moved, whether or not it counts [mm]."""
    corrected_operations: list[_Operation] | None
    """Operations whose motion parameters were corrected."""
    tried_corrections: list[FreedSet] | None
    """Which operations were freed at which step, and the gap that was left."""
    extra_steps: Annotated[int, Meta(ge=-1_000_000, le=1_000_000)] | None
    """Steps of the plan beyond doing every operation once."""
    fit_adjustments: list[FreeMoved] | None
    """What of a corrected plan was moved where contacts leave it free, so that it fits; null where there is none."""
    failure_prediction: FailurePrediction | None
    """The prediction of failure, before the plan is executed."""
    predicted_success: _Share | None
    """Predicted success probability, before the plan is executed; null without a plan."""
    gap_before_mm: _Number | None
    """Gap of the contacts at the observed poses [mm]."""
    gap_after_mm: _Number | None
    """Gap of the contacts at the corrected poses [mm]."""
    chi_square: Annotated[float, Meta(ge=0.0, le=1e300)] | None
    """Statistic of the test whether contacts and observed poses are consistent."""
    chi_square_dof: Annotated[int, Meta(ge=0, le=LARGEST_SEED)] | None
    """Degrees of freedom of `chi_square`."""
    p_value: _Share | None
    """p-value of `chi_square`."""
    consistent: bool | None
    """Whether contacts and observed poses are consistent by that test."""
    suspects: list[Name] | None
    """Contacts that the test suspects."""
    dropped_contacts: list[Name] | None
    """Contacts that the corrector left out."""
    rejected_observations: list[_Operation] | None
    """Operations that were inferred, since nothing was observed of them or the corrector rejects it."""
    reobservations: _Count | None
    """How many operations were observed again, all together; null without a corrector."""
    wrong_contact: Name | None
    """The contact that is wrong, where wrong ones were given."""
    inside_95: bool | None
    """Whether the truth lies in the 95 % region that the corrector states."""
    planned_error_fixed_mm: _Size | None
    """Root mean square distance of the plan from the truth, along directions that contacts fix [mm]."""
    planned_error_free_mm: _Size | None
    """Root mean square distance of the plan from the truth, along directions that contacts leave free [mm]."""
    contacts_true_positive: _Count | None
    """Given contacts that are right."""
    contacts_false_negative: _Count | None
    """True contacts that were not given."""
    contacts_false_positive: _Count | None
    """Given contacts that are wrong."""
    joint_control: str | None
    """What moved the joints of the arm, its own actuators or servos made for it, and how much stronger the drive of its
    gripper was made; null where nothing was carried out."""
    reached: dict[str, _Pose] | None
    """Part -> where it ended: x, y, z [mm], qw, qx, qy, qz, world frame."""
    pose_error_fixed_mm: _Size | None
    """Root mean square distance of where the parts ended from the truth, along directions that contacts fix [mm]."""
    pose_error_free_mm: _Size | None
    """Root mean square distance of where the parts ended from the truth, along directions left free [mm]."""
    peak_force_n: _Size | None
    """Largest contact force on what was held, without the gripper's, behind a low-pass filter of 20 ms [N]."""
    grasp_slip: list[GraspSlip] | None
    """How far each part moved in the hand, slid, rolled or turned, until its last motion began and until its end."""
    probe_contacts: _Count | None
    """Probe contacts that the robot used. This and what follows is null for a robot that does not probe."""
    probe_contacts_rejected: _Count | None
    """Probe contacts that contradicted the others, so that the robot rejected them."""
    base_error_estimate_mm: _Size | None
    """The final estimate of the error of the robot's base, at the middle of the poses [mm]."""
    base_error_estimate_deg: _Size | None
    """The same as an angle [deg]."""
    base_error_std_mm: _Size | None
    """The stated standard deviation of that: root mean square, as a vector [mm]."""
    base_error_std_deg: _Size | None
    """The same of the angle [deg]."""
    sim_time_s: _Size | None
    """Simulated time [s]."""


def _setting_columns() -> Iterator[tuple[str, Any]]:
    literal: Any = Literal
    for name, info in SETTINGS.items():
        kind = Name if name == "secret_seed" else literal[info.choices] if info.choices else info.kind
        yield name, kind | None if info.drawn else kind


_LITERAL: Any = Literal
_CODE = _LITERAL[tuple(CODES)] | None
_CLOSED = dict.fromkeys(("demonstration", "failure_code", "as_demonstrated_code"), _CODE)
_CLOSED["failure_stage"] = _LITERAL[STAGES] | None
RECORD_FIELDS: Mapping[str, Any] = MappingProxyType(
    {"schema": Name, "env_id": Name, "config_hash": Name}
    | dict(_setting_columns())
    | {name: kind for name, kind in get_type_hints(TrialRecord, include_extras=True).items() if name not in _COLUMNS}
    | _CLOSED
)
"""Column -> its type, with the range that it may have."""
REQUIRED = (
    *("schema", "env_id", "config_hash", *(name for name in SETTINGS if name != "secret_seed")),
    *("demonstration", "success", "loose_success", "failure_stage", "failure_code"),
)
"""Columns without which a line is no record; other columns that are missing are null."""


def replace_infinite(x: float | None) -> float | None:
    """A number that a record can hold, else null."""
    return float(x) if x is not None and abs(x) <= LARGEST_NUMBER else None


Key = tuple[Any, ...]
"""The columns `KEY` of a record."""
KEY = tuple(info.name for info in SETTINGS.values() if info.key)
_KEY_VALUES = itemgetter(*KEY)


def get_record_key(record: Mapping[str, Any]) -> Key:
    """The key of the trial that a record is of."""
    key: Key = _KEY_VALUES(record)
    return key


def make_trial_key(trial: TrialConfig, scenario: str) -> Key:
    """The key of a trial.

    Args:
        scenario: The name of the scenario.
    """
    return get_record_key(list_setting_columns(trial, scenario))


def list_setting_columns(settings: TrialConfig, scenario: str) -> dict[str, Any]:
    """The settings as they stand in a record.

    Args:
        scenario: The name of the scenario.
    """
    columns = {info.name: getattr(settings, name) for name, info in SETTINGS.items()}
    return columns | {
        "scenario": scenario,
        "secret_seed": None if settings.secret_seed is None else settings.secret_seed.hash,
    }


def restore_settings(record: Mapping[str, Any], scenario: str) -> TrialConfig:
    """The settings of the trial that a record is of, without its salt, which no record tells.

    Args:
        scenario: A name, or the path of a scenario file.
    """
    values = {name: record.get(info.name, info.default) for name, info in SETTINGS.items()}
    return TrialConfig(**(values | {"scenario": scenario, "secret_seed": None}))


def convert_to_python_units(options: Mapping[str, Any]) -> dict[str, Any]:
    """Settings by their names, in the units of Python, out of those by their options; other names stay."""
    values = dict(options)
    for name, info in SETTINGS.items():
        if info.keyword != name and info.keyword in values:
            value = values.pop(info.keyword)
            values[name] = value if info.scale == 1.0 else value * info.scale
    return values
