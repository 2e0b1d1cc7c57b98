"""Settings, options, trial, observation and final `info` of an episode of an environment."""

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
from apo_bench.trial.trial_stages import SimulatedDemonstration, simulate_demonstration

MOST_SCENES = 8
"""Most compiled scenes of other clearances that are kept."""
MOST_TRIES = 30
"""`reset()` gives up after this many failed demonstrations in a row."""


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
    """Clearance per side; None: that of the scenario."""

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
    """Its images are dropped to save memory."""
    observation: Observation
    reobserve: Reobservations
    """Observes operations of this trial again."""


_OF_TOOLS = frozenset({"lerobot_new_rollout"})
"""Options that evaluation tools pass to every environment; they have no effect."""
_OPTIONS = ("trial", *(field.name for field in fields(EpisodeSettings)))


def episode_options(options: object) -> dict[str, Any]:
    """Return the options of `reset()` without those of evaluation tools.

    Raises:
        InputError: The options are no dict, or one is unknown.
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
    """Return the number of the trial, from the option `trial` or else the seed; None if neither is given.

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
    """Return the settings of an episode: the usual ones, changed by the options.

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
    """Simulate the demonstration of a trial.

    Args:
        number: The trial, whose demonstration may fail; None draws trials until a demonstration succeeds.

    Returns:
        The number of the trial, and its demonstration.

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
    """Cache of a scene compiled for several clearances."""

    def __init__(self, usual: Scene) -> None:
        self._usual = usual
        self._others: dict[float, Scene] = {}

    def of(self, clearance_mm: float | None) -> Scene:
        """Return the scene with a clearance; None: that of the scenario.

        Raises:
            InputError: A part cannot have this clearance.
        """
        usual = self._usual
        clearance = float(usual.scenario.clearance_mm if clearance_mm is None else clearance_mm)
        if clearance == usual.clearance_mm:
            return usual
        # a scene is taken out and put back, so that the least recently used one comes first
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
    """An integer in `info` that is None in other environments of a vector; NumPy gathers these as objects."""


@final
class NullableFloat(float):
    """A number in `info` that is None in other environments of a vector."""


def nullable(x: float | None) -> float | None:
    """Return the number in a type that a vector environment can gather together with None."""
    if x is None:
        return None
    return NullableInt(x) if isinstance(x, int) else NullableFloat(x)


def predicted_info(predicted: Mapping[str, Any]) -> dict[str, Any]:
    """Return a failure prediction for `info`, with the keys of a trial record."""
    return {**predicted, **{name: nullable(predicted[name]) for name in ("operation", "size_mm")}}


def verdicts(verdict: Verdict) -> dict[str, bool]:
    """Return the three verdicts by their key in `info`."""
    return dict(zip(VERDICTS, (verdict.success, verdict.as_demonstrated, verdict.loose_success), strict=True))


def step_info(
    verdicts: Mapping[str, bool], end: Outcome, predicted: FailurePrediction | None, predicted_success: float | None
) -> dict[str, Any]:
    """Return the `info` of the last step; predictions that are None are left out."""
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
