"""One episode of an environment: settings, observation and final `info`."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, final

import numpy as np

from apo_bench.assembly import Observation, Outcome
from apo_bench.errors import InputError, shown, unknown
from apo_bench.judging.verdict import Verdict
from apo_bench.perception.observation.noise import NoiseLevel
from apo_bench.perception.observation.reobservations import Reobservations
from apo_bench.records import FailurePrediction, check, parse_noise_level
from apo_bench.simulation.scene import Scene, build_scene
from apo_bench.trial.stages import SimulatedDemonstration, simulate_demonstration

MOST_SCENES = 8
"""Compiled scenes of other clearances that are kept."""
MOST_TRIES = 30
"""Failed demonstrations in a row after which `reset()` gives up."""


@final
@dataclass(frozen=True)
class EpisodeSettings:
    """The settings that may differ between episodes.

    Raises:
        InputError: A number that is not allowed.
    """

    noise_level: NoiseLevel
    human_error_scale: float
    clearance_mm: float | None
    """Default: the scenario's."""

    def __post_init__(self) -> None:
        check("human_error_scale", self.human_error_scale)
        if self.clearance_mm is not None:
            check("clearance_mm", self.clearance_mm)


@final
@dataclass(frozen=True, eq=False)
class Episode:
    """One trial, demonstrated and observed."""

    trial: int
    simulated: SimulatedDemonstration
    """Without its images."""
    observation: Observation
    reobserve: Reobservations
    """None where no reobservation is allowed."""


_OF_TOOLS = frozenset({"lerobot_new_rollout"})
"""Options that evaluation tools pass to every environment; they have no effect."""
_OPTIONS = ("trial", *(field.name for field in fields(EpisodeSettings)))


def episode_options(options: object) -> dict[str, Any]:
    """The options of `reset()`, without those that evaluation tools pass to every environment.

    Raises:
        InputError: Not a dict, or an unknown option.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise InputError(
            f"{shown(options)} was given as options of reset(); a dict with {', '.join(_OPTIONS)} is allowed."
        )
    asked = {name: value for name, value in options.items() if name not in _OF_TOOLS}
    for name in asked:
        if name not in _OPTIONS:
            raise InputError(unknown("option of reset()", str(name), _OPTIONS))
    return asked


def trial_number(seed: int | None, asked: Mapping[str, Any]) -> int | None:
    """The number of the trial, from the seed or the option `trial`; None where neither is given.

    Raises:
        InputError: A number that is not allowed.
    """
    if seed is not None:
        check("seed", seed)
    trial = asked.get("trial")
    if trial is None:
        return seed
    check("seed", trial, called="trial")
    return int(trial)


def replace_settings(usual: EpisodeSettings, asked: Mapping[str, Any], pose_source: str) -> EpisodeSettings:
    """The settings of an episode: the usual ones with those that the options change.

    Raises:
        InputError: A value that is not allowed.
    """
    changes = {name: value for name, value in asked.items() if name != "trial"}
    if "noise_level" in changes:
        changes["noise_level"] = NoiseLevel(*parse_noise_level(changes["noise_level"], pose_source))
    return replace(usual, **changes)


def simulate_trial(
    scene: Scene, human_error_scale: float, pose_source: str, number: int | None, rng: np.random.Generator
) -> tuple[int, SimulatedDemonstration]:
    """A trial and its demonstration: the one of this number, or else the first of random ones that succeeds.

    Raises:
        InputError: `MOST_TRIES` demonstrations in a row failed.
    """
    for _ in range(1 if number is not None else MOST_TRIES):
        trial = int(number) if number is not None else int(rng.integers(2**31))
        simulated = simulate_demonstration(scene, human_error_scale, trial, pose_source)
        if number is not None or simulated.demonstration.code == "ok":
            return trial, simulated
    raise InputError(
        f"{MOST_TRIES} demonstrations of '{scene.scenario.name}' in a row failed with a human error scale of "
        f"{human_error_scale:g} and {scene.clearance_mm:g} mm clearance; reduce the human error scale, or check the "
        "scenario."
    )


@final
class Scenes:
    """A compiled scene, and the same scene compiled for other clearances."""

    def __init__(self, usual: Scene) -> None:
        self._usual = usual
        self._others: dict[float, Scene] = {}

    def of(self, clearance_mm: float | None) -> Scene:
        """The scene of a clearance; default: the scenario's.

        Raises:
            InputError: A part cannot have it.
        """
        usual = self._usual
        clearance = float(usual.scenario.clearance_mm if clearance_mm is None else clearance_mm)
        if clearance == usual.clearance_mm:
            return usual
        scene = self._others.pop(clearance, None) or build_scene(
            usual.scenario,
            clearance_mm=clearance,
            grasp=usual.grasp,
            arm=usual.arm,
            timestep_s=usual.physics.timestep_s,
        )
        while len(self._others) >= MOST_SCENES:
            del self._others[next(iter(self._others))]
        self._others[clearance] = scene
        return scene


VERDICTS = ("is_success", "as_demonstrated", "loose_success")
"""Keys of `info` that hold verdicts."""


@final
class NullableInt(int):
    """An integer where other environments of a vector may have None: NumPy gathers these into an array of objects."""


@final
class NullableFloat(float):
    """A number where other environments of a vector may have None."""


def nullable(x: float | None) -> float | None:
    """The number in a type that a vector environment can gather together with None."""
    if x is None:
        return None
    return NullableInt(x) if isinstance(x, int) else NullableFloat(x)


def predicted_info(predicted: Mapping[str, Any]) -> dict[str, Any]:
    """A failure prediction as in a record, for `info`."""
    return {**predicted, **{name: nullable(predicted[name]) for name in ("operation", "size_mm")}}


def verdicts(verdict: Verdict) -> dict[str, bool]:
    """The verdicts by key."""
    return dict(zip(VERDICTS, (verdict.success, verdict.as_demonstrated, verdict.loose_success), strict=True))


def step_info(
    verdicts: Mapping[str, bool], end: Outcome, predicted: FailurePrediction | None, predicted_success: float | None
) -> dict[str, Any]:
    """`info` after the last step."""
    return {
        **verdicts,
        "success": verdicts["is_success"],
        "stage": end.stage,
        "code": end.code,
        "operation": nullable(None if end.operation is None else end.operation + 1),
        "sentence": end.sentence,
        **({} if predicted is None else {"failure_prediction": predicted_info(predicted)}),
        **({} if predicted_success is None else {"predicted_success": predicted_success}),
    }
