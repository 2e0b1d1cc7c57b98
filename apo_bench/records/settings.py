"""What one trial is made of: every setting, stated once and checked at the door.

What else lists settings is made from this: columns and keys of rows, axes of sweeps, keys of sweep files, options and
help of the command line, replay commands, and the tables of the documentation. The file is long because all that
is to be known of a setting stands in one place.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from numbers import Real
from typing import Annotated, Literal, Never, final, get_args, get_type_hints

import numpy as np
from msgspec import Meta

from apo_bench.errors import InputError, require, require_text
from apo_bench.records.robot_error import (
    DRAWN,
    NO_ROBOT_ERROR,
    USUAL_WRENCH,
    checked_robot_error,
    checked_stated_error,
    checked_wrench,
)
from apo_bench.records.salt import Salt
from apo_bench.records.setting_info import SettingInfo, about, check_value
from apo_bench.records.short_names import CORRECTOR, checked_method, checked_relations, feels

ENV_ID = "APOReplay-v0"
ROW = "apo-bench/row/9"
Eye = Literal["noise", "range"]
"""Poses with noise that is drawn, or a simulated range finder that measures them."""
RANGE = "range"
USUAL = "isotropic"
"""The noise model where none is asked for."""
Fidelity = Literal["full", "contact"]
"""Every motion is simulated, or the part of each in which things may touch."""
LARGEST_SEED = 2**53 - 1
"""Whole numbers up to here survive every JSON reader."""
LONGEST_NAME = 5000
"""Letters; some names are paths."""
Name = Annotated[str, Meta(min_length=1, max_length=LONGEST_NAME)]
NoiseLevel = Annotated[float, Meta(ge=0.0, le=50.0)]
"""[mm] or [degrees]: five times the largest is still inside the room."""
CarelessnessValue = Annotated[float, Meta(ge=0.0, le=10.0)]
ClearanceMm = Annotated[float, Meta(ge=0.0, le=5.0)]
Seed = Annotated[int, Meta(ge=0, le=LARGEST_SEED)]
Promise = Annotated[float, Meta(ge=0.0, le=1.0)]
"""A probability of success."""
LooksAllowed = Annotated[int, Meta(ge=0, le=100)]
TimestepS = Annotated[float, Meta(gt=0.0, le=1.0)]
LEVEL = SettingInfo(
    "Noise: mm and degrees, standard deviation",
    option="level",
    usual="1",
    axis="levels",
    axis_option="levels",
    swept=(0.0, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0),
    name="level",
    kind=NoiseLevel,
)
"""One number stands for `level_mm` and `level_deg`."""
_PER_AXIS = "where 1 means a standard deviation of 1 mm and 1 degree"
_PER_RAY = "where 1 means a standard deviation of 1 mm per ray"


@final
@dataclass(frozen=True)
class TrialSettings:
    """One trial: with the same code and the same assets it determines its row, which has them in this order."""

    scenario: Name = field(metadata=about(key=True, axis="scenarios"))
    """A name, also `generated:SEED` or `generated:FAMILY:SEED`, or the path of a scenario file."""
    level_mm: NoiseLevel = field(
        default=1.0,
        metadata=about(
            "Only the mm",
            called="level in mm",
            meaning=_PER_AXIS,
            column="level",
            usual="the level",
            key=True,
        ),
    )
    """Standard deviation of the positions seen, per axis [mm]; with the eye `range`, of one ray."""
    level_deg: NoiseLevel = field(
        default=1.0,
        metadata=about("Only the degrees", called="level in degrees", meaning=_PER_AXIS, usual="the level", key=True),
    )
    """Standard deviation of the angles seen, per axis [deg]; zero with the eye `range`."""
    careless: CarelessnessValue = field(
        default=1.0,
        metadata=about(
            "Carelessness of the human: 0 is a careful one, 1 the scenario's",
            called="carelessness",
            meaning="where 0 is a careful human and 1 the scenario's",
            key=True,
            axis="careless",
            swept=(0.0, 1.0),
        ),
    )
    """How far the human deviates: 0 is a careful one, 1 the scenario's, anything else a multiple."""
    clearance_mm: ClearanceMm = field(
        default=0.25,
        metadata=about(
            "Room between parts that fit, in mm per side",
            called="clearance",
            meaning="in mm per side",
            option="clearance",
            usual="the scenario's",
            key=True,
            axis="clearances_mm",
            scene=True,
        ),
    )
    """Room per side between parts that fit into one another [mm]."""
    eye: str = field(
        default="noise",
        metadata=about(
            "How poses are seen: noise (drawn), or range (measured in depth images; the level is mm per ray)",
            called="eye",
            choices=get_args(Eye),
            axis="eyes",
        ),
    )
    """`noise`, or `range`: poses are measured in depth images; `level_mm` is the noise of a ray then, `level_deg` is
    zero and `noise` is `range`."""
    noise: Name = field(
        default=USUAL,
        metadata=about(
            "A name out of `apo-bench noise list`, FILE.toml, empirical:FILE.csv, or package.module:name",
            key=True,
            axis="noises",
        ),
    )
    """A noise model, by name, as a file, or `module:name`."""
    grasp: Name = field(
        default="friction",
        metadata=about(
            "friction, or weld for an ideal gripper",
            called="grasp",
            choices=("friction", "weld"),
            key=True,
            axis="grasps",
            scene=True,
        ),
    )
    """`friction`, or `weld` for an ideal gripper."""
    arm: Name = field(
        default="six_axis",
        metadata=about(
            "A name out of `apo-bench arm list`, FILE.toml, menagerie:NAME (of MuJoCo Menagerie), robosuite:NAME, or "
            "package.module:name",
            shared=True,
            scene=True,
        ),
    )
    """The robot, by name, as a file, or `module:name`."""
    robot_error: Name = field(
        default=NO_ROBOT_ERROR,
        metadata=about(
            "Standard deviations of the robot's own errors: none, hand_eye:1/0.2 (mm/degrees), joints:0.05 (degrees), "
            "tool:0.5 (mm), in_hand:0.5/1 (mm/degrees), or several joined by +",
            spelled=checked_robot_error,
            key=True,
            axis="robot_errors",
        ),
    )
    """What is wrong with the robot itself: `none`, or standard deviations by kind, `hand_eye:1/0.2+tool:0.5`."""
    relations: Name = field(
        default="given",
        metadata=about(
            "What correctors are told of the contacts: given (right), recognised, "
            "recognised-jointly, missed, false, shifted:3 (mm)",
            spelled=checked_relations,
            key=True,
            axis="relations",
        ),
    )
    """What a corrector is told of the contacts: `given`, `recognised`, `recognised-jointly`, or wrong ones: `missed`,
    `false`, `shifted:3` (mm), or `module:name`."""
    method: Name = field(
        default=CORRECTOR,
        metadata=about(
            "oracle, none, by-heart, search, a corrector or package.module:name; any of them with +search or +feel",
            spelled=checked_method,
            key=True,
            axis="methods",
            axis_option="methods",
            swept=("oracle", "none", "paper", CORRECTOR),
        ),
    )
    """Who plans: `oracle`, `none`, `by-heart`, `search`, a corrector by name, or `module:name`; with `+search` the
    robot feels for holes besides, with `+feel` it also finds out by touching how wrong it is itself."""
    looks: LooksAllowed = field(
        default=0,
        metadata=about(
            "How often a corrector that can ask may look at operations again",
            called="number of looks",
            key=True,
            axis="looks",
        ),
    )
    """How often a corrector that can ask may look at operations again; each look has the errors of the first."""
    wrench: Name = field(
        default=USUAL_WRENCH,
        metadata=about(
            "The force and torque sensor at the wrist, with +feel only: ideal, external, external-coarse, cobot, or "
            "its noise in N and Nm, 0.1/0.005",
            spelled=checked_wrench,
            key=True,
            axis="wrenches",
        ),
    )
    """The force and torque sensor at the wrist: `ideal`, `external`, `external-coarse`, `cobot`, or standard deviations
    of a reading in N and Nm, `0.1/0.005`. Without `+feel` nothing reads it."""
    stated_error: Name = field(
        default=DRAWN,
        metadata=about(
            "How wrong the robot is said to be, with +feel only: drawn (the standard deviations of the robot error), "
            "unstated, or standard deviations as those of a robot error",
            spelled=checked_stated_error,
            key=True,
            axis="stated_errors",
        ),
    )
    """How wrong the robot is said to be: `drawn`, by the standard deviations of `robot_error`; `unstated`; or by
    others, `hand_eye:1/0.2`. Without `+feel` nobody asks."""
    abstain: Promise = field(
        default=0.0,
        metadata=about(
            "Carry out nothing that promises to succeed with less than this probability; 0 carries out everything",
            called="promise to abstain below",
            meaning="where 0 never abstains",
            key=True,
            axis="abstains",
        ),
    )
    """A plan whose `promised` is less is not carried out: no success."""
    seed: Seed = field(default=0, metadata=about("Number of the trial", called="seed", key=True))
    """Number of the trial: trials of one seed meet the same layout, human and noise."""
    salt: Salt | None = field(
        default=None,
        repr=False,
        metadata=about("The salt of the sweep that the trial is of", option="salt-file", usual="none"),
    )
    """Enters every stream of chance; None for a trial that everybody can draw. A row has its hash."""
    timestep_s: TimestepS = field(
        default=0.001,
        metadata=about(
            "Time step of the physics in ms: 1 for tables, 0.5 to check",
            option="timestep-ms",
            scale=1e-3,
            shared=True,
            scene=True,
        ),
    )
    """Time step of the physics [s]."""
    fidelity: str = field(
        default="full",
        metadata=about(
            "full, or contact: only the part of each motion in which things may touch is simulated",
            called="fidelity",
            choices=get_args(Fidelity),
            shared=True,
        ),
    )
    """`full`, or `contact`: only the part of each motion in which things may touch is simulated."""

    def __post_init__(self) -> None:
        for info in SETTINGS.values():
            value = getattr(self, info.name)
            if info.is_text:
                require_text(info.name.replace("_", " "), value)
            elif isinstance(value, np.generic):
                object.__setattr__(self, info.name, value.item())
        for info in _CHECKED:
            check(info.name, getattr(self, info.name), self.eye)
            if info.spelled is not None:
                object.__setattr__(self, info.name, info.spelled(getattr(self, info.name)))
        check_together(self.fidelity, self.grasp)
        check_squares(feels(self.method), self.grasp)
        if self.eye == RANGE:
            if self.noise not in (USUAL, RANGE):
                refuse_noise(self.noise)
            object.__setattr__(self, "noise", RANGE)
            object.__setattr__(self, "level_deg", 0.0)


def _settings() -> Iterable[SettingInfo]:
    kinds = get_type_hints(TrialSettings, include_extras=True)
    for setting in fields(TrialSettings):
        name = setting.name
        info: SettingInfo = setting.metadata["info"]
        column = info.column or name
        option = info.option or name.replace("_", "-")
        yield replace(info, name=name, kind=kinds[name], default=setting.default, column=column, option=option)


SETTINGS: Mapping[str, SettingInfo] = {info.name: info for info in _settings()}
"""Name -> what is to be known of it, in the order of a row."""
_CHECKED = tuple(info for info in SETTINGS.values() if info.called or info.spelled)


def check(name: str, value: object, eye: str = "noise", called: str = "") -> None:
    """Raise an `InputError` unless a setting may be this, whatever the others are.

    Args:
        eye: What levels are of.
        called: What to call it, if not as usual.
    """
    check_value(SETTINGS[name], value, called, _PER_RAY if name == "level_mm" and eye == RANGE else "")


def check_together(fidelity: str, *grasps: str) -> None:
    """Raise an `InputError` unless the verdicts of a fidelity are known to be those of `full` with these grasps."""
    require(
        fidelity != "contact" or "weld" not in grasps,
        "the fidelity 'contact' was given together with the grasp 'weld', with which its verdicts differ; "
        "use the grasp friction, or full.",
    )


def check_squares(feels: bool, *grasps: str) -> None:
    """Raise an `InputError` if a robot that feels, which squares parts between its pads, has none that close."""
    require(
        not feels or "weld" not in grasps,
        "the grasp 'weld' was given for a robot that feels, which squares parts between pads that close; use the "
        "grasp friction, or a robot that does not feel.",
    )


def level_pair(level: float | Sequence[float], eye: str = "noise") -> tuple[float, float]:
    """A level in mm and in degrees: one number stands for both, a pair for each; of a ray it is one, in mm."""
    several = tuple(level) if isinstance(level, Iterable) and not isinstance(level, str) else (level,)
    is_numbers = all(isinstance(x, Real) and not isinstance(x, bool | np.bool_) for x in several)
    numbers = tuple(map(float, several)) if is_numbers else ()
    require(
        eye != RANGE or len(numbers) == 1,
        f"the level {level!r} was given with the eye 'range'; one number is allowed, mm per ray.",
    )
    require(
        len(numbers) in (1, 2), f"the level {level!r} was given; one number is allowed, or a pair of mm and degrees."
    )
    mm = numbers[0]
    deg = 0.0 if eye == RANGE else numbers[-1]
    check("level_mm", mm, eye)
    check("level_deg", deg)
    return mm, deg


def refuse_noise(*noises: object) -> Never:
    """Raise an `InputError`: noise models were asked for where poses are measured, so they would draw nothing."""
    names = ", ".join(f"'{noise}'" for noise in noises if isinstance(noise, str))
    raise InputError(
        f"the noise {names or 'model'} was given together with the eye 'range', which draws no pose noise; the level "
        "is the noise of its rays in mm, so leave one of the two out."
    )
