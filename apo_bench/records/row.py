"""A row: all that is kept of one trial, one line of `trials.jsonl`.

Lengths are in mm, angles in degrees, quaternions are wxyz, operations are numbered from 1. What is written and read is
checked by these types: finite numbers in their range, and no other fields.

The settings of a trial as columns of its row: which of them tell trials apart, and settings out of rows and options.

Trials of one sweep differ in the columns `KEY`.
"""

from collections.abc import Mapping
from operator import itemgetter
from types import MappingProxyType
from typing import Annotated, Any, Literal, NotRequired, TypedDict, get_type_hints

from msgspec import Meta

from apo_bench.records.outcomes import CODES, STAGES
from apo_bench.records.settings import (
    LARGEST_SEED,
    SETTINGS,
    CarelessnessValue,
    ClearanceMm,
    Eye,
    Fidelity,
    LooksAllowed,
    Name,
    NoiseLevel,
    Promise,
    Seed,
    TimestepS,
    TrialSettings,
)

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


class MovedInHand(TypedDict):
    """An operation, and how far its part moved in the hand after the grasp, [mm] and [deg]."""

    operation: _Operation
    carried_mm: _Size
    carried_deg: _Size
    """When its last motion, to its place, began."""
    mm: _Size
    deg: _Size
    """When it was let go of, or the replay failed."""


class Predicted(TypedDict):
    """What a plan said about itself, and how far off it is then [mm]."""

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


class Row(TypedDict, total=False):
    """A whole row has all of these, in this order; what a part of a trial finds out is some of them."""

    schema: Name
    """Version of these fields."""
    env_id: Name
    """Version of the environment."""
    spec_hash: Name
    """16 digits over the code, the files and all settings but method and seed: rows with the same may be counted
    together."""
    scenario: Name
    """Name of the scenario."""
    level: NoiseLevel | None
    """Standard deviation of the positions seen, per axis [mm]; with the eye `range`, of one ray. Null if measured."""
    level_deg: NoiseLevel | None
    """Standard deviation of the angles seen, per axis [deg]; zero with the eye `range`. Null if measured."""
    careless: CarelessnessValue | None
    """How far the human deviates: 0 is a careful one, 1 the scenario's. Null if measured."""
    clearance_mm: ClearanceMm
    """Room per side between parts that fit into one another [mm]."""
    eye: Eye
    """`noise`: poses with noise that is drawn; `range`: measured in depth images."""
    noise: Name
    """The noise model; `range` with that eye, `measured` for an observation from a file."""
    grasp: Name
    """`friction`, or `weld` for an ideal gripper."""
    arm: Name
    """The robot."""
    robot_error: Name
    """What is wrong with the robot itself: `none`, or standard deviations of what was drawn, `hand_eye:1/0.2`."""
    relations: Name
    """What the corrector was told of the contacts: `given`, `recognised`, or wrong ones."""
    method: Name
    """Who planned: `oracle`, `none`, `by-heart`, `search` or a corrector; with `+search` or `+feel` by what robot."""
    looks: LooksAllowed
    """How often a corrector that can ask was allowed to look at operations again."""
    wrench: Name
    """The force and torque sensor at the wrist; without `+feel` nothing read it."""
    stated_error: Name
    """How wrong the robot was said to be: `drawn`, by the standard deviations of `robot_error`; `unstated`; or by
    others. Without `+feel` nobody asked."""
    abstain: Promise
    """A plan that promised less was not carried out."""
    seed: Seed
    """Number of the trial: trials of one seed meet the same layout, human and noise."""
    salt: Name | None
    """Hash of the secret that the trial was drawn with; null for one that everybody can draw."""
    timestep_s: TimestepS
    """Time step of the physics [s]."""
    fidelity: Fidelity
    """`full`, or `contact`: only the part of each motion in which things may touch was simulated."""
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
    pushed_mm: _Number | None
    """Largest distance by which a part that was in place was moved in the room, whether or not it counts [mm]."""
    freed: list[_Operation] | None
    """Operations whose motion parameters were corrected."""
    tried: list[FreedSet] | None
    """Which operations were freed at which step, and the gap that was left."""
    extra_operations: Annotated[int, Meta(ge=-1_000_000, le=1_000_000)] | None
    """Steps of the plan beyond doing every operation once."""
    free_moved: list[FreeMoved] | None
    """What of a corrected plan was moved where contacts leave it free, so that it fits; null where there is none."""
    predicted: Predicted | None
    """What the plan said about itself before it was carried out."""
    promised: _Share | None
    """Probability of success that the plan stated before it was carried out; null where there was no plan."""
    gap_before_mm: _Number | None
    """Gap of the contacts at the poses seen [mm]."""
    gap_after_mm: _Number | None
    """Gap of the contacts at the corrected poses [mm]."""
    chi_square: Annotated[float, Meta(ge=0.0, le=1e300)] | None
    """Statistic of the test whether contacts and poses seen are consistent."""
    chi_square_freedom: Annotated[int, Meta(ge=0, le=LARGEST_SEED)] | None
    """Degrees of freedom of `chi_square`."""
    p_value: _Share | None
    """p-value of `chi_square`."""
    test_passes: bool | None
    """Whether contacts and poses seen are consistent by that test."""
    suspects: list[Name] | None
    """Contacts that the test suspects."""
    dropped: list[Name] | None
    """Contacts that the corrector left out."""
    left_out: list[_Operation] | None
    """Operations of which nothing that was seen was believed, or nothing was seen, and that were inferred."""
    seen_again: _Count | None
    """How often operations were looked at again, all together; null where no corrector was asked."""
    wrong_relation: Name | None
    """The contact that is wrong, where wrong ones were given."""
    inside_95: bool | None
    """Whether the truth lies in the 95 % region that the corrector states."""
    planned_error_fixed_mm: _Size | None
    """Root mean square distance of the plan from the truth, along directions that contacts fix [mm]."""
    planned_error_free_mm: _Size | None
    """Root mean square distance of the plan from the truth, along directions that contacts leave free [mm]."""
    contacts_right: _Count | None
    """Contacts that the corrector was told and that are right."""
    contacts_missed: _Count | None
    """Contacts that are there and that the corrector was not told."""
    contacts_false: _Count | None
    """Contacts that the corrector was told and that are not there."""
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
    moved_in_hand: list[MovedInHand] | None
    """How far each part moved in the hand, slid, rolled or turned, until its last motion began and until its end."""
    touches: _Count | None
    """Touches that told the robot something about itself. This and what follows is null of a robot that does not feel.
    """
    touches_refused: _Count | None
    """Touches that contradicted the others and what was stated, so that they were not believed."""
    felt_mm: _Size | None
    """How far the robot's base was believed to be off in the end, at the middle of the goals [mm]."""
    felt_deg: _Size | None
    """The same as an angle [deg]."""
    felt_sure_mm: _Size | None
    """How far that may be wrong, as the robot says itself: root mean square, as a vector [mm]."""
    felt_sure_deg: _Size | None
    """The same of the angle [deg]."""
    sim_seconds: _Size | None
    """Simulated time [s]."""


_ENDS: Any = Literal
_CODE = _ENDS[tuple(CODES)] | None
_CLOSED = dict.fromkeys(("demonstration", "failure_code", "as_demonstrated_code"), _CODE)
_CLOSED["failure_stage"] = _ENDS[STAGES] | None
ROW_FIELDS: Mapping[str, Any] = MappingProxyType(get_type_hints(Row, include_extras=True) | _CLOSED)
"""Column -> its type, with the range that it may have."""
_SETTING_COLUMNS = (info.column for info in SETTINGS.values() if info.name != "salt")
REQUIRED = (
    *("schema", "env_id", "spec_hash", *_SETTING_COLUMNS),
    *("demonstration", "success", "loose_success", "failure_stage", "failure_code"),
)
"""Without them a line is no row; what else a row does not say is null."""


def look_up(row: Row, column: str) -> Any:
    """What a row says in a column that is not named where this is written."""
    return row.get(column)


def finite(x: float | None) -> float | None:
    """A number that a row can hold, else null."""
    return float(x) if x is not None and abs(x) <= LARGEST_NUMBER else None


Key = tuple[Any, ...]
"""The columns `KEY` of a row."""
KEY = tuple(info.column for info in SETTINGS.values() if info.key)
_KEY_VALUES = itemgetter(*KEY)


def row_key(row: Mapping[str, Any]) -> Key:
    """The key of the trial that a row is of."""
    key: Key = _KEY_VALUES(row)
    return key


def trial_key(trial: TrialSettings, scenario: str) -> Key:
    """The key of a trial.

    Args:
        scenario: The name of the scenario.
    """
    return row_key(setting_columns(trial, scenario))


def setting_columns(settings: TrialSettings, scenario: str) -> dict[str, Any]:
    """The settings as they stand in a row.

    Args:
        scenario: The name of the scenario.
    """
    columns = {info.column: getattr(settings, name) for name, info in SETTINGS.items()}
    return columns | {"scenario": scenario, "salt": None if settings.salt is None else settings.salt.hash}


def settings_of(row: Mapping[str, Any], scenario: str) -> TrialSettings:
    """The settings of the trial that a row is of, without its salt, which no row tells.

    Args:
        scenario: A name, or the path of a scenario file.
    """
    values = {name: row.get(info.column, info.default) for name, info in SETTINGS.items()}
    return TrialSettings(**(values | {"scenario": scenario, "salt": None}))


def in_python(options: Mapping[str, Any]) -> dict[str, Any]:
    """Settings by their names, in the units of Python, out of those by their options; other names stay."""
    values = dict(options)
    for name, info in SETTINGS.items():
        if info.keyword != name and info.keyword in values:
            value = values.pop(info.keyword)
            values[name] = value if info.scale == 1.0 else value * info.scale
    return values
