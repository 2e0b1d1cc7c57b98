"""One episode: its settings, which `reset(options=...)` may say, its scene, and what was seen in it.

What an environment says in `info`, where a number may be missing.

A vector environment gathers the infos of its environments into arrays. If the first has an `int` it makes an array
that holds nothing but ints, and a None of the next one raises; numbers of these types go into an array of objects.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, final

import numpy as np

from apo_bench.assembly import Observation, Outcome
from apo_bench.errors import InputError, shown, unknown
from apo_bench.judging.verdict import Verdict
from apo_bench.perception.observation.noise import NoiseLevel
from apo_bench.perception.observation.reobservations import Reobservations
from apo_bench.records import Predicted, check, noise_pair
from apo_bench.simulation.scene import Scene, build_scene
from apo_bench.trial.stages import SimulatedDemonstration, simulate_demonstration

MOST_SCENES = 8
"""So many compiled scenes of other clearances are kept."""
MOST_TRIES = 30
"""So many demonstrations in a row may go wrong before `reset()` gives up."""


@final
@dataclass(frozen=True)
class Settings:
    """What may differ from episode to episode; checked when it is made."""

    noise_level: NoiseLevel
    human_error_scale: float
    clearance_mm: float | None
    """None stands for the scenario's."""

    def __post_init__(self) -> None:
        check("human_error_scale", self.human_error_scale)
        if self.clearance_mm is not None:
            check("clearance_mm", self.clearance_mm)


@final
@dataclass(frozen=True, eq=False)
class Episode:
    """One trial as it was demonstrated and seen."""

    trial: int
    simulated: SimulatedDemonstration
    """Without its images."""
    seen: Observation
    look: Reobservations | None
    """None where no looks are allowed."""


_OF_TOOLS = frozenset({"lerobot_new_rollout"})
"""Options that evaluation tools pass to every environment; they mean nothing here."""
_OPTIONS = tuple(field.name for field in fields(Settings))


def asked_options(options: object, allowed: Sequence[str]) -> dict[str, Any]:
    """What is asked of `reset()`, without what evaluation tools pass to every environment.

    Raises:
        InputError: No dict, or an option that there is not.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise InputError(
            f"{shown(options)} was given as options of reset(); a dict with {', '.join(allowed)} is allowed."
        )
    asked = {name: value for name, value in options.items() if name not in _OF_TOOLS}
    for name in asked:
        if name not in allowed:
            raise InputError(unknown("option of reset()", str(name), allowed))
    return asked


def with_options(usual: Settings, options: object, pose_source: str) -> Settings:
    """The settings of an episode: the usual ones, but for what the options say.

    Raises:
        InputError: An option that there is not, or a value that is not allowed.
    """
    changes = asked_options(options, _OPTIONS)
    if "noise_level" in changes:
        changes["noise_level"] = NoiseLevel(*noise_pair(changes["noise_level"], pose_source))
    return replace(usual, **changes)


def watch_human(
    scene: Scene, human_error_scale: float, pose_source: str, seed: int | None, rng: np.random.Generator
) -> tuple[int, SimulatedDemonstration]:
    """Trial `seed`, or the next one of those that are drawn whose demonstration is right.

    Raises:
        InputError: None of `MOST_TRIES` is right.
    """
    for _ in range(1 if seed is not None else MOST_TRIES):
        trial = int(seed) if seed is not None else int(rng.integers(2**31))
        simulated = simulate_demonstration(scene, human_error_scale, trial, pose_source)
        if seed is not None or simulated.demonstration.code == "ok":
            return trial, simulated
    raise InputError(
        f"{MOST_TRIES} demonstrations of '{scene.scenario.name}' in a row went wrong at carelessness {human_error_scale:g} and "
        f"{scene.clearance_mm:g} mm clearance; give less carelessness, or mend the scenario."
    )


@final
class Scenes:
    """A scene, and the same compiled for other clearances."""

    def __init__(self, usual: Scene) -> None:
        self._usual = usual
        self._others: dict[float, Scene] = {}

    def of(self, clearance_mm: float | None) -> Scene:
        """The scene of a clearance; None stands for the scenario's.

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
"""Keys of what the judge says."""


@final
class NullableInt(int):
    """A whole number beside which None may stand."""


@final
class NullableFloat(float):
    """A number beside which None may stand."""


def nullable(x: float | None) -> float | None:
    """The number as one beside which None may stand."""
    if x is None:
        return None
    return NullableInt(x) if isinstance(x, int) else NullableFloat(x)


def predicted_info(predicted: Mapping[str, Any]) -> dict[str, Any]:
    """What a plan said about itself, as in a row, fit for infos."""
    return {**predicted, **{name: nullable(predicted[name]) for name in ("operation", "size_mm")}}


def verdicts(verdict: Verdict) -> dict[str, bool]:
    """What the judge says."""
    return dict(zip(VERDICTS, (verdict.success, verdict.as_demonstrated, verdict.loose_success), strict=True))


def step_info(
    verdicts: Mapping[str, bool], end: Outcome, predicted: Predicted | None, predicted_success: float | None
) -> dict[str, Any]:
    """What is said after a step: the verdicts, where the replay ended, and what the plan had said of itself."""
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
