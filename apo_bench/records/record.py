"""The record of a trial: one line of `trials.jsonl`.

Lengths are in mm, angles in degrees, quaternions are wxyz, operations are numbered from 1. These types check a record
whenever it is written or read: numbers are finite and in range, and there are no other columns. The columns `KEY`
distinguish the trials of one sweep.
"""

from collections.abc import Iterator, Mapping
from operator import itemgetter
from types import MappingProxyType
from typing import Annotated, Any, Literal, NotRequired, TypedDict, get_type_hints

from msgspec import Meta

from apo_bench.records.outcomes import CODES, STAGES
from apo_bench.records.settings import LARGEST_SEED, SETTINGS, Name, TrialConfig

LONGEST_SENTENCE = 1000  # letters
LARGEST_NUMBER = 1e15
"""Bound of numbers from physics or a solver; sums and plots of larger ones have no meaning."""
_Number = Annotated[float, Meta(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
_Size = Annotated[float, Meta(ge=0.0, le=LARGEST_NUMBER)]
_Share = Annotated[float, Meta(ge=0.0, le=1.0)]
_Count = Annotated[int, Meta(ge=0, le=1_000_000)]
_Operation = Annotated[int, Meta(ge=1, le=100_000)]
_Pose = Annotated[list[_Number], Meta(min_length=7, max_length=7)]


class FreedSet(TypedDict):
    """Operations that were freed at a step of the schedule, and the contact gap that was left [mm]."""

    step: _Operation
    free: list[_Operation]
    gap_mm: _Number | None


class FreeMoved(TypedDict):
    """The distance by which the target pose of an operation was moved, [mm] and [deg]."""

    operation: _Operation
    mm: _Size
    deg: _Size


class GraspSlip(TypedDict):
    """The distance by which a part moved in the hand after the grasp, [mm] and [deg]."""

    operation: _Operation
    carried_mm: _Size
    carried_deg: _Size
    """At the beginning of its last motion, to its place."""
    mm: _Size
    deg: _Size
    """At its release, or when the replay failed."""


class FailurePrediction(TypedDict):
    """The failure prediction of a plan, and the size of the predicted error [mm]."""

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
    """Why the arm cannot execute the plan."""


class _Columns(TypedDict, total=False):
    """Columns before the results that code accesses by name; `RECORD_FIELDS` has the columns of all settings."""

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
    """A record with results; a complete one has all of these columns, in this order."""

    thresholds: dict[str, _Size] | None
    """Thresholds of the judge: lengths in mm, angles in degrees."""
    demonstration: str | None
    """Outcome of the human's own assembly: `ok` or a code."""
    success: bool | None
    """Whether the finished assembly is correct; null if the demonstration failed, so that the trial does not count."""
    as_demonstrated: bool | None
    """Whether every contact was also made when and where it was demonstrated."""
    loose_success: bool | None
    """Success with the loose thresholds, 5 mm and 5 degrees."""
    failure_stage: str | None
    """Stage at which the trial failed; null for a success."""
    failure_code: str | None
    """Code of the failure; null for a success."""
    failure_operation: _Operation | None
    """Operation in which the trial failed, if it is known."""
    sentence: str | None
    """The outcome as a sentence."""
    as_demonstrated_code: str | None
    """Code of why the assembly was not made as demonstrated."""
    conditions: dict[str, bool] | None
    """Condition of success -> whether it holds."""
    worst_gap_mm: _Number | None
    """Largest gap, or penetration, of faces that should touch [mm]."""
    worst_angle_deg: _Number | None
    """Largest angle between faces that should touch [deg]."""
    least_overlap: _Number | None
    """Smallest overlap of faces that should touch, as a share of the true overlap."""
    penetration_mm: _Number | None
    """Largest penetration of one part into another [mm]."""
    placed_part_shift_mm: _Number | None
    """Largest distance by which a part that was in place was moved, whether or not it affects the verdict [mm]."""
    corrected_operations: list[_Operation] | None
    """Operations whose motion parameters were corrected."""
    tried_corrections: list[FreedSet] | None
    """The operations that were freed at each step, and the gap that was left."""
    extra_steps: Annotated[int, Meta(ge=-1_000_000, le=1_000_000)] | None
    """Steps of the plan beyond doing every operation once."""
    fit_adjustments: list[FreeMoved] | None
    """Poses of the corrected plan that were moved along free directions, so that parts fit; null if there are none."""
    failure_prediction: FailurePrediction | None
    """The prediction of failure, before the plan is executed."""
    predicted_success: _Share | None
    """Predicted success probability of the plan, before it is executed; null without a plan."""
    gap_before_mm: _Number | None
    """Gap of the contacts at the observed poses [mm]."""
    gap_after_mm: _Number | None
    """Gap of the contacts at the corrected poses [mm]."""
    chi_square: Annotated[float, Meta(ge=0.0, le=1e300)] | None
    """Statistic of the test of consistency between contacts and observed poses."""
    chi_square_dof: Annotated[int, Meta(ge=0, le=LARGEST_SEED)] | None
    """Degrees of freedom of `chi_square`."""
    p_value: _Share | None
    """p-value of `chi_square`."""
    consistent: bool | None
    """Whether that test finds contacts and observed poses consistent."""
    suspects: list[Name] | None
    """Contacts that the test suspects."""
    dropped_contacts: list[Name] | None
    """Contacts that the corrector left out."""
    rejected_observations: list[_Operation] | None
    """Operations whose pose was inferred, since they were not observed or the corrector rejected the observation."""
    reobservations: _Count | None
    """Number of reobservations of all operations; null without a corrector."""
    wrong_contact: Name | None
    """The wrong contact, if the contact source adds, omits or displaces one."""
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
    """How the joints are driven: by the arm's own actuators, or by servos made for it; null if nothing was executed.

    The text also states the factor by which the drive of the gripper was made stronger.
    """
    final_poses: dict[str, _Pose] | None
    """Part -> its final pose: x, y, z [mm], qw, qx, qy, qz, world frame."""
    pose_error_fixed_mm: _Size | None
    """Root mean square distance of final poses from the truth, along directions that contacts fix [mm]."""
    pose_error_free_mm: _Size | None
    """Root mean square distance of final poses from the truth, along directions that contacts leave free [mm]."""
    peak_force_n: _Size | None
    """Largest contact force on the held part, without that of the gripper, after a low-pass filter of 20 ms [N]."""
    grasp_slip: list[GraspSlip] | None
    """How far each part moved in the hand, until its last motion began and until its release."""
    probe_contacts: _Count | None
    """Probe contacts that the robot used; this and the following columns are null for a robot that does not probe."""
    probe_contacts_rejected: _Count | None
    """Probe contacts that the robot rejected, since they contradicted the others."""
    base_error_estimate_mm: _Size | None
    """Final estimate of the error of the robot's base, at the centre of the poses [mm]."""
    base_error_estimate_deg: _Size | None
    """The same as an angle [deg]."""
    base_error_estimate_std_mm: _Size | None
    """Stated standard deviation of that estimate: root mean square of the vector [mm]."""
    base_error_estimate_std_deg: _Size | None
    """Stated standard deviation of the angle [deg]."""
    sim_time_s: _Size | None
    """Simulated time [s]."""


def _setting_columns() -> Iterator[tuple[str, Any]]:
    """Yield name and type of the column of each setting; settings of a random draw may be null."""
    literal: Any = Literal
    for name, info in SETTINGS.items():
        kind = Name if name == "secret_seed" else literal[info.choices] if info.choices else info.kind
        yield name, kind | None if info.drawn else kind


_LITERAL: Any = Literal  # mypy allows no computed Literal
_CODE = _LITERAL[tuple(CODES)] | None
# columns that have one of a few values
_CLOSED = dict.fromkeys(("demonstration", "failure_code", "as_demonstrated_code"), _CODE)
_CLOSED["failure_stage"] = _LITERAL[STAGES] | None
RECORD_FIELDS: Mapping[str, Any] = MappingProxyType(
    {"schema": Name, "env_id": Name, "config_hash": Name}
    | dict(_setting_columns())
    | {name: kind for name, kind in get_type_hints(TrialRecord, include_extras=True).items() if name not in _COLUMNS}
    | _CLOSED
)
"""Column -> its type, with its range."""
REQUIRED = (
    *("schema", "env_id", "config_hash", *(name for name in SETTINGS if name != "secret_seed")),
    *("demonstration", "success", "loose_success", "failure_stage", "failure_code"),
)
"""Columns that every record must have; other missing columns are null."""


def replace_infinite(x: float | None) -> float | None:
    """Return a number that a record can hold, or None for one that is infinite, NaN or too large."""
    return float(x) if x is not None and abs(x) <= LARGEST_NUMBER else None


Key = tuple[Any, ...]
"""The values of the columns `KEY`, which identify a trial within a sweep."""
KEY = tuple(info.name for info in SETTINGS.values() if info.key)
_KEY_VALUES = itemgetter(*KEY)


def get_record_key(record: Mapping[str, Any]) -> Key:
    """Return the key of the trial of a record."""
    key: Key = _KEY_VALUES(record)
    return key


def make_trial_key(trial: TrialConfig, scenario: str) -> Key:
    """Return the key of a trial.

    Args:
        scenario: Name of the scenario.
    """
    return get_record_key(list_setting_columns(trial, scenario))


def list_setting_columns(settings: TrialConfig, scenario: str) -> dict[str, Any]:
    """Return the columns of a record that hold the settings.

    Args:
        scenario: Name of the scenario.
    """
    columns = {info.name: getattr(settings, name) for name, info in SETTINGS.items()}
    return columns | {
        "scenario": scenario,
        "secret_seed": None if settings.secret_seed is None else settings.secret_seed.hash,
    }


def restore_settings(record: Mapping[str, Any], scenario: str) -> TrialConfig:
    """Return the settings of the trial of a record, without its secret seed, which a record does not hold.

    Args:
        scenario: A name, or the path of a scenario file.
    """
    values = {name: record.get(info.name, info.default) for name, info in SETTINGS.items()}
    return TrialConfig(**(values | {"scenario": scenario, "secret_seed": None}))


def convert_to_python_units(options: Mapping[str, Any]) -> dict[str, Any]:
    """Rename options to settings, and convert their values to the units of Python; other names stay."""
    values = dict(options)
    for name, info in SETTINGS.items():
        if info.keyword != name and info.keyword in values:
            value = values.pop(info.keyword)
            values[name] = value if info.scale == 1.0 else value * info.scale
    return values
