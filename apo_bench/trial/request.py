"""What is asked for of one trial, its settings, and what is seen of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, final

from apo_bench.assembly.goals import Observation
from apo_bench.errors import InputError
from apo_bench.records.limits import CORRECTOR_LIMIT_S
from apo_bench.records.relations import RECOGNISED
from apo_bench.records.salt import read_salt
from apo_bench.records.setting_columns import in_python
from apo_bench.records.settings import LEVEL, RANGE, TrialSettings
from apo_bench.scenario.file import load_scenario
from apo_bench.simulation.scene.scene import Scene
from apo_bench.trial.kept_demonstrations import demonstration_of
from apo_bench.trial.scene import scene_of
from apo_bench.trial.stages import (
    SimulatedDemonstration,
    demonstration_failure,
    observe_demonstration,
)
from apo_bench.trial.trial import noise_of

_DRAWN = (
    LEVEL.name,
    "level_mm",
    "level_deg",
    "careless",
    "noise",
    "relations",
    "eye",
    "looks",
    "robot_error",
    "seed",
    "salt_file",
)
"""What has no meaning for an observation that comes from a file, though its contacts may be recognised."""


@final
@dataclass(frozen=True)
class Request:
    """One replay."""

    scenario: str
    options: Mapping[str, Any] = field(default_factory=dict)
    """Option as an argument (`level`, `clearance`, `salt_file`, ...) -> value; what is not there or None is as usual.
    """
    observation: Path | None = None
    save_observation: Path | None = None
    video: Path | None = None
    corrector_limit_s: float = CORRECTOR_LIMIT_S
    """Wall time that a corrector named as `module:name` may take."""
    cache: Path | None = None
    """A folder where demonstrations are kept; the row is the same with and without it."""


def requested_settings(request: Request, clearance_mm: float) -> TrialSettings:
    """The settings that a request means.

    Args:
        clearance_mm: Of the scenario, where the request does not say.

    Raises:
        InputError: A setting that is not allowed, or two that contradict each other.
    """
    options = {name: value for name, value in request.options.items() if value is not None}
    if request.observation:
        _refuse_contradictions(request, options)
    for name in ("noise", "level_deg"):
        if options.get("eye") == RANGE and name in options:
            raise InputError(
                f"{_option(name)} was given together with --eye range, which draws no pose noise; "
                "--level is the noise of its rays in mm."
            )
    usual: dict[str, Any] = {"scenario": request.scenario, "clearance_mm": clearance_mm}
    if "level" in options:
        usual |= dict.fromkeys(("level_mm", "level_deg"), options.pop("level"))
    if "salt_file" in options:
        options["salt_file"] = read_salt(options["salt_file"])
    return TrialSettings(**(usual | in_python(options)))


def looked_at(
    scenario: str,
    observation: Path | None,
    options: Mapping[str, Any],
    deviation_mm: float | None,
    deviation_deg: float | None,
) -> tuple[Observation, bool]:
    """What is seen of a trial, or stands in a file, and whether standard deviations had to be assumed.

    Args:
        options: What only a trial knows: level, seed, noise and so on, as in `Request`.
        deviation_mm, deviation_deg: What only a file may need.

    Raises:
        InputError: One of the two was given with the other, or something is not allowed.
    """
    of_file = {"deviation_mm": deviation_mm, "deviation_deg": deviation_deg}
    refused, reason = (of_file, "is for files") if observation is None else (options, "draws a trial")
    for name, value in refused.items():
        if value is not None:
            where = "without" if observation is None else "together with"
            raise InputError(
                f"{_option(name)}, which {reason}, was given {where} --observation; leave one of them out."
            )
    if observation is None:
        return watched(Request(scenario, options)), False
    from apo_bench.files.observation import read_observation_file

    seen, _, assumed = read_observation_file(
        observation, scenario, deviation_mm=deviation_mm, deviation_deg=deviation_deg
    )
    return seen, assumed


def watched(request: Request) -> Observation:
    """What is seen of the trial that was asked for; nothing is replayed.

    Raises:
        InputError: A setting that is not allowed, or two that contradict each other.
        RuntimeError: The demonstration itself failed.
    """
    scenario = load_scenario(request.scenario)
    spec = requested_settings(request, scenario.clearance_mm)
    scene = scene_of(spec, scenario)
    simulated = demonstration_of(spec, scene)
    if simulated.demonstration.code != "ok":
        raise RuntimeError(f"{demonstration_failure(simulated.demonstration).sentence}; try another seed")
    return look(spec, scene, simulated)


def look(spec: TrialSettings, scene: Scene, simulated: SimulatedDemonstration) -> Observation:
    """The demonstration of a trial through its eye."""
    return observe_demonstration(simulated, noise_of(spec, scene, simulated), spec.seed, spec.salt)


def _refuse_contradictions(request: Request, options: Mapping[str, Any]) -> None:
    may_be = options.get("relations") in ("given", *RECOGNISED)
    drawn = [name for name in _DRAWN if name in options and not (name == "relations" and may_be)]
    files = [name for name in ("save_observation", "cache") if getattr(request, name) is not None]
    for name in (*drawn, *files):
        raise InputError(
            f"{_option(name)} was given together with --observation, which draws nothing; leave one of them out."
        )


def _option(name: str) -> str:
    return "--" + name.replace("_", "-")
