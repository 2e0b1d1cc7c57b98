"""The settings of a trial, each stated once: columns, sweep axes, file keys, options and tables derive from them.

The file is long because all that is stated about a setting stands at its field.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any, Literal, final, get_args, get_type_hints

import numpy as np
from msgspec import Meta

from apo_bench.errors import require
from apo_bench.records.contact_sources import check_contact_source
from apo_bench.records.ft_sensor import USUAL_FT_SENSOR, normalise_ft_sensor
from apo_bench.records.methods import CORRECTOR, check_method, probes
from apo_bench.records.robot_error import (
    MATCHED,
    NO_ROBOT_ERROR,
    normalise_assumed_robot_error,
    normalise_robot_error,
)
from apo_bench.records.secret_seed import SecretSeed
from apo_bench.records.setting_info import SettingInfo, about

ENV_ID = "APOReplay-v0"
RECORD_SCHEMA = "apo-bench/record/1"
PoseSource = Literal["noise-model", "depth-camera"]
NOISE_MODEL, DEPTH_CAMERA = get_args(PoseSource)
USUAL = "isotropic"
"""The default noise model."""
Fidelity = Literal["full", "near-contact"]
NEAR_CONTACT = "near-contact"
LARGEST_SEED = 2**53 - 1
"""The largest integer that every JSON reader keeps exact."""
LONGEST_NAME = 5000
"""Most characters of a name; some names are paths."""
Name = Annotated[str, Meta(min_length=1, max_length=LONGEST_NAME)]
NoiseSize = Annotated[float, Meta(ge=0.0, le=50.0)]
"""[mm] or [deg]; five standard deviations of the largest noise are still inside the space that observations cover."""
HumanErrorScale = Annotated[float, Meta(ge=0.0, le=10.0)]
ClearanceMm = Annotated[float, Meta(ge=0.0, le=5.0)]
Seed = Annotated[int, Meta(ge=0, le=LARGEST_SEED)]
Probability = Annotated[float, Meta(ge=0.0, le=1.0)]
ReobservationCount = Annotated[int, Meta(ge=0, le=100)]
TimestepS = Annotated[float, Meta(gt=0.0, le=1.0)]
NOISE_LEVEL = SettingInfo(
    "Standard deviation of the observed poses per axis, in mm and in degrees",
    option="noise-level",
    heading="Observation",
    usual="1",
    axis=True,
    swept=(0.0, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0),
    name="noise_level",
    kind=NoiseSize,
)
"""A setting of sweeps and commands that sets `noise_mm` and `noise_deg`."""


@final
@dataclass(frozen=True)
class TrialConfig:
    """The settings of one trial; with the same version and files they determine its record.

    They are the first columns of a record, in this order.

    Examples:
        >>> import apo_bench
        >>> apo_bench.TrialConfig("stick_in_tower", noise_mm=0.5, method="contact", seed=7).noise_deg
        1.0
    """

    scenario: Name = field(metadata=about(key=True, axis=True))
    """A scenario by name, also `generated:SEED` or `generated:FAMILY:SEED`, or the path of a scenario file."""
    noise_mm: NoiseSize = field(
        default=1.0,
        metadata=about(
            "Standard deviation of the observed positions per axis, in mm",
            heading="Observation",
            usual="the noise level",
            key=True,
            drawn=True,
        ),
    )
    """Standard deviation of the observed positions, per axis [mm]; with the pose source `depth-camera`, of one ray."""
    noise_deg: NoiseSize = field(
        default=1.0,
        metadata=about(
            "Standard deviation of the observed rotation vectors per axis, in degrees",
            heading="Observation",
            usual="the noise level",
            key=True,
            drawn=True,
        ),
    )
    """Standard deviation of the observed rotation vectors in the body frame, per axis [deg]; 0 with the pose source
    `depth-camera`."""
    human_error_scale: HumanErrorScale = field(
        default=1.0,
        metadata=about(
            "Factor on the human error that the scenario states; 0 is an ideal human",
            heading="Task and robot",
            key=True,
            drawn=True,
            axis=True,
        ),
    )
    """Factor on the human error that the scenario states: 0 is an ideal human."""
    clearance_mm: ClearanceMm = field(
        default=0.25,
        metadata=about(
            "Clearance per side between parts that fit, in mm",
            heading="Task and robot",
            usual="the scenario's",
            key=True,
            axis=True,
            scene=True,
        ),
    )
    """Clearance per side between parts that fit into one another [mm]."""
    pose_source: str = field(
        default=NOISE_MODEL,
        metadata=about(
            "Where observed poses come from: noise-model, or depth-camera (estimated from simulated depth images; the "
            "noise level is then in mm per ray)",
            heading="Observation",
            choices=get_args(PoseSource),
            axis=True,
        ),
    )
    """`noise-model`, or `depth-camera`: poses are estimated from simulated depth images; `noise_mm` is then the noise
    of a ray, `noise_deg` is 0 and `noise` is `depth-camera`."""
    noise: Name = field(
        default=USUAL,
        metadata=about(
            "Noise model: a name from `apo-bench noise list`, FILE.toml, empirical:FILE.csv, poses:FILE.csv (of images "
            "of the trials), or package.module:name",
            heading="Observation",
            key=True,
            axis=True,
        ),
    )
    """A noise model, by name, as a file, or `module:name`."""
    grasp: Name = field(
        default="friction",
        metadata=about(
            "How the gripper holds parts: friction, or weld for an ideal gripper",
            heading="Task and robot",
            choices=("friction", "weld"),
            key=True,
            axis=True,
            scene=True,
        ),
    )
    """`friction`, or `weld` for an ideal gripper."""
    arm: Name = field(
        default="six_axis",
        metadata=about(
            "Robot arm: a name from `apo-bench arm list`, FILE.toml, menagerie:NAME (of MuJoCo Menagerie), "
            "robosuite:NAME, or package.module:name",
            heading="Task and robot",
            shared=True,
            scene=True,
        ),
    )
    """The robot arm, by name, as a file, or `module:name`."""
    robot_error: Name = field(
        default=NO_ROBOT_ERROR,
        metadata=about(
            "Standard deviations of the robot's own errors: none, hand_eye:1/0.2 (mm/degrees), joints:0.05 (degrees), "
            "tool:0.5 (mm), in_hand:0.5/1 (mm/degrees), sag:0.5 (mm), base_tilt:0.1 (degrees), finger:0.5 (mm), "
            "ft_drift:1 (N a minute), or several joined by +",
            heading="Task and robot",
            spelled=normalise_robot_error,
            key=True,
            axis=True,
        ),
    )
    """Errors of the robot itself: `none`, or standard deviations by kind, `hand_eye:1/0.2+tool:0.5`."""
    contact_source: Name = field(
        default="given",
        metadata=about(
            "Where the corrector's contacts come from: given (correct), detected, detected-jointly, or wrong ones: "
            "false-negative, false-positive, face-offset:3mm",
            heading="Correction",
            spelled=check_contact_source,
            key=True,
            axis=True,
        ),
    )
    """Where the corrector's contacts come from: `given`, `detected`, `detected-jointly`, or wrong ones:
    `false-negative`, `false-positive`, `face-offset:3mm`, or `module:name`."""
    method: Name = field(
        default=CORRECTOR,
        metadata=about(
            "contact-robust or another corrector (`apo-bench method list`), package.module:name, uncorrected (observed "
            "poses), nominal (poses of the scenario file), oracle (true poses), spiral-search; +spiral and +probe add "
            "a spiral search and probing",
            heading="Correction",
            spelled=check_method,
            key=True,
            axis=True,
            swept=("oracle", "uncorrected", "paper", CORRECTOR),
        ),
    )
    """What makes the plan: `oracle`, `uncorrected`, `nominal`, `spiral-search`, a corrector by name, or `module:name`.
    With `+spiral` the robot searches for holes in a spiral; with `+probe` it also probes fixed surfaces to estimate its
    own calibration error."""
    max_reobservations: ReobservationCount = field(
        default=0,
        metadata=about(
            "How often a corrector may observe operations again",
            heading="Correction",
            key=True,
            axis=True,
        ),
    )
    """How often a corrector that requests it may observe operations again, with the noise of the first observation."""
    ft_sensor: Name = field(
        default=USUAL_FT_SENSOR,
        metadata=about(
            "Force-torque sensor of a robot that probes: ideal, wrist, wrist-coarse, joint-torque, or its noise in N "
            "and Nm, 0.1/0.005",
            heading="Robot that probes",
            spelled=normalise_ft_sensor,
            key=True,
            axis=True,
        ),
    )
    """The force-torque sensor at the wrist: `ideal`, `wrist`, `wrist-coarse`, `joint-torque`, or standard deviations
    of a reading in N and Nm, `0.1/0.005`. Only methods with `+probe` read it."""
    assumed_robot_error: Name = field(
        default=MATCHED,
        metadata=about(
            "Robot error that a robot that probes assumes: matched (the standard deviations of --robot-error), "
            "unknown, or standard deviations",
            heading="Robot that probes",
            spelled=normalise_assumed_robot_error,
            key=True,
            axis=True,
        ),
    )
    """The robot error that a robot that probes assumes: `matched`, the standard deviations of `robot_error`; `unknown`;
    or standard deviations, `hand_eye:1/0.2`. Only methods with `+probe` use it."""
    min_predicted_success: Probability = field(
        default=0.0,
        metadata=about(
            "Abstain from plans whose predicted success is lower; 0 executes every plan",
            heading="Correction",
            key=True,
            axis=True,
        ),
    )
    """A plan with a lower `predicted_success` is not executed, and does not count as a success."""
    seed: Seed = field(default=0, metadata=about("Number of the trial", heading="Trials", key=True))
    """Number of the trial: at the same seed, all methods have the same layout, demonstration and noise."""
    secret_seed: SecretSeed | None = field(
        default=None,
        repr=False,
        metadata=about(
            "File with the secret seed of the sweep",
            heading="Trials",
            option="secret-seed-file",
            usual="none",
            drawn=True,
        ),
    )
    """Secret that enters every random stream; None for a trial that anyone can draw. A record has its hash."""
    timestep_s: TimestepS = field(
        default=0.001,
        metadata=about(
            "Time step of the physics, in ms; smaller is slower and more exact",
            heading="Simulation",
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
            "full, or near-contact: simulate only the part of each motion in which parts may touch",
            heading="Simulation",
            choices=get_args(Fidelity),
            shared=True,
        ),
    )
    """`full`, or `near-contact`: only the part of each motion in which parts may touch is simulated."""

    def __post_init__(self) -> None:
        for info in SETTINGS.values():
            value = getattr(self, info.name)
            if isinstance(value, np.generic):
                value = value.item()  # a number of NumPy
            info.check(value)
            object.__setattr__(self, info.name, info.spelled(value) if info.spelled else value)
        check_together(self.fidelity, self.grasp)
        check_grip(probes(self.method), self.grasp)
        if self.pose_source == DEPTH_CAMERA:
            refuse_noise(*{self.noise} - {USUAL, DEPTH_CAMERA})
            object.__setattr__(self, "noise", DEPTH_CAMERA)
            object.__setattr__(self, "noise_deg", 0.0)


def _settings() -> Iterable[SettingInfo]:
    """Yield the settings with name, type, default and option from the fields of `TrialConfig`."""
    kinds = get_type_hints(TrialConfig, include_extras=True)
    for setting in fields(TrialConfig):
        name = setting.name
        info: SettingInfo = setting.metadata["info"]
        option = info.option or name.replace("_", "-")
        yield replace(info, name=name, kind=kinds[name], default=setting.default, option=option)


SETTINGS: Mapping[str, SettingInfo] = {info.name: info for info in _settings()}
"""Settings by name, in the order of the columns of a record."""


def check(name: str, value: object, called: str = "") -> None:
    """Raise an `InputError` unless a setting may have this value, whatever the other settings are.

    Args:
        called: Name of the setting in the message; default: its own.
    """
    SETTINGS[name].check(value, called)


def check_together(fidelity: str, *grasps: str) -> None:
    """Raise an `InputError` for grasps with which the verdicts of a fidelity differ from those of `full`."""
    require(
        fidelity != NEAR_CONTACT or "weld" not in grasps,
        "the fidelity 'near-contact' was given together with the grasp 'weld', with which its verdicts differ; "
        "use the grasp friction, or the fidelity full.",
    )


def check_grip(probes: bool, *grasps: str) -> None:
    """Raise an `InputError` if a robot that probes has no pads that close, between which it aligns parts."""
    require(
        not probes or "weld" not in grasps,
        "the grasp 'weld' was given for a method with +probe, which aligns parts between pads that close; use the "
        "grasp friction, or a method without +probe.",
    )


def parse_noise_level(noise_level: float | Sequence[float], pose_source: str = NOISE_MODEL) -> tuple[float, float]:
    """Return a noise level in mm and in degrees.

    One number stands for both, and a pair for each. With the depth camera there is one number, in mm per ray, and 0
    degrees.
    """
    is_several = isinstance(noise_level, Iterable) and not isinstance(noise_level, str)
    several: tuple[Any, ...] = tuple(noise_level) if is_several else (noise_level,)  # type: ignore[arg-type]
    per_ray = pose_source == DEPTH_CAMERA
    allowed = "one number, mm per ray" if per_ray else "one number, or a pair of mm and degrees"
    # a bool counts as 0 or 1
    require(1 <= len(several) <= 2 - per_ray, f"noise level must be {allowed}, got {noise_level!r}.")
    check("noise_mm", several[0], "noise level")
    check("noise_deg", several[-1], "noise level")
    return float(several[0]), 0.0 if per_ray else float(several[-1])


def refuse_noise(*noises: object) -> None:
    """Raise an `InputError` if a noise model is given for a pose source that draws no pose noise."""
    names = ", ".join(noise for noise in noises if isinstance(noise, str))
    require(
        not noises,
        f"the noise {names or 'model'} was given together with the pose source 'depth-camera', which draws no pose "
        "noise; the noise level is the noise of its rays in mm, so leave one of the two out.",
    )
