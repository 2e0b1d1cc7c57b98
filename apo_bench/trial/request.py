"""One trial as it is asked for: its settings, what is seen of it, its row, a film, a file.

The file is long, as all options of `replay` meet here.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, final

from apo_bench.assembly import Observation
from apo_bench.errors import InputError, require
from apo_bench.io import read_text
from apo_bench.records import (
    DEPTH_CAMERA,
    DETECTED,
    NOISE_LEVEL,
    TrialConfig,
    TrialRecord,
    in_python,
    read_secret_seed,
)
from apo_bench.scenario import Scenario, in_the_air, load_scenario
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.simulation.film.film import write_film
from apo_bench.simulation.film.track import FilmTrack
from apo_bench.simulation.graphics import renderer
from apo_bench.simulation.scene import Scene, check_film
from apo_bench.trial.fingerprint import config_hash, content_hash
from apo_bench.trial.outcome_columns import lost
from apo_bench.trial.rollout import Rollout, trial_story
from apo_bench.trial.stages import (
    SimulatedDemonstration,
    demonstration_failure,
    demonstration_of,
    observe_demonstration,
    scene_of,
)
from apo_bench.trial.trial import MEASURED, noise_of, run_measured, trial_row

Show = Callable[[Rollout], None]
_DRAWN = (
    *(NOISE_LEVEL.name, "noise_mm", "noise_deg", "human_error_scale", "noise", "contact_source"),
    *("pose_source", "max_reobservations", "robot_error", "seed", "secret_seed_file"),
)
"""What has no meaning for an observation that comes from a file, though its contacts may be recognised."""
_MEASURED_AIR_M = 5e-3
"""A start that was measured may be wrong by so much: as far apart as `loose_success` lets faces be."""


@final
@dataclass(frozen=True)
class Request:
    """One replay."""

    scenario: str
    options: Mapping[str, Any] = field(default_factory=dict)
    """Option as an argument (`noise_level`, `clearance`, `salt_file`, ...) -> value; what is not there or None is as usual.
    """
    observation: Path | None = None
    save_observation: Path | None = None
    video: Path | None = None


def requested_settings(request: Request, clearance_mm: float) -> TrialConfig:
    """The settings that a request means.

    Args:
        clearance_mm: Of the scenario, where the request does not say.

    Raises:
        InputError: A setting that is not allowed, or two that contradict each other.
    """
    options = {name: value for name, value in request.options.items() if value is not None}
    if request.observation:
        _refuse_contradictions(request, options)
    for name in ("noise", "noise_deg"):
        require(
            options.get("pose_source") != DEPTH_CAMERA or name not in options,
            f"{_option(name)} was given together with --pose-source depth-camera, which draws no pose noise; "
            "--noise-level is the noise of its rays in mm.",
        )
    usual: dict[str, Any] = {"scenario": request.scenario, "clearance_mm": clearance_mm}
    if "noise_level" in options:
        usual |= dict.fromkeys(("noise_mm", "noise_deg"), options.pop("noise_level"))
    if "secret_seed_file" in options:
        options["secret_seed_file"] = read_secret_seed(options["secret_seed_file"])
    return TrialConfig(**(usual | in_python(options)))


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
        return _watched(Request(scenario, options)), False
    from apo_bench.formats.observation import read_observation_file

    seen, _, assumed = read_observation_file(
        observation, scenario, deviation_mm=deviation_mm, deviation_deg=deviation_deg
    )
    return seen, assumed


def _watched(request: Request) -> Observation:
    """What is seen of the trial that was asked for; nothing is replayed."""
    scenario = load_scenario(request.scenario)
    spec = requested_settings(request, scenario.clearance_mm)
    scene = scene_of(spec, scenario)
    simulated = demonstration_of(spec, scene)
    if simulated.demonstration.code != "ok":
        raise RuntimeError(f"{demonstration_failure(simulated.demonstration).sentence}; try another seed")
    return look(spec, scene, simulated)


def look(spec: TrialConfig, scene: Scene, simulated: SimulatedDemonstration) -> Observation:
    """The demonstration of a trial through its eye."""
    return observe_demonstration(simulated, noise_of(spec, scene, simulated), spec.seed, spec.secret_seed)


def _refuse_contradictions(request: Request, options: Mapping[str, Any]) -> None:
    may_be = options.get("contact_source") in ("given", *DETECTED)
    drawn = [name for name in _DRAWN if name in options and not (name == "contact_source" and may_be)]
    saved = ["save_observation"] if request.save_observation is not None else []
    for name in (*drawn, *saved):
        raise InputError(
            f"{_option(name)} was given together with --observation, which draws nothing; leave one of them out."
        )


def _option(name: str) -> str:
    return "--" + name.replace("_", "-")


def run_request(request: Request, show: Show | None = None) -> TrialRecord:
    """Run the trial, or the replay of a measured observation, that was asked for.

    Args:
        show: Called with what is to be seen of the trial, if anything was replayed.

    Raises:
        InputError: A setting that is not allowed, or two that contradict each other.
    """
    _, spec = checked_request(request)
    return run_settings(request, spec, show)


def run_settings(request: Request, spec: TrialConfig, show: Show | None = None) -> TrialRecord:
    """Run the trial of these settings; the request says what to read and to write.

    Args:
        show: As in `run_request`.
    """
    scene = scene_of(spec)
    simulated = None
    track = FilmTrack() if request.video or show else None
    watch = None if track is None else track.hooks
    if request.video:
        renderer(scene.work.model, 16, 12).close()  # is there anything to draw with? asked before the trial is run
    seen: Observation | None = None
    if request.observation:
        from apo_bench.formats.observation import read_stated

        path = request.observation
        seen = read_stated(path, scene.scenario)
        aloft = in_the_air(seen.assembly, seen.start, _MEASURED_AIR_M)
        if aloft is not None:
            raise InputError(f"{path}, start, {aloft[0]}: {aloft[1]}; give the pose at which it stands.")
        row = run_measured(spec, scene, seen, read_text(path, "observation file"), watch=watch)
    else:
        simulated = demonstration_of(spec, scene)
        row = _drawn(request, spec, scene, simulated, watch)
        if track is not None and row["sim_time_s"] is not None:
            seen = look(spec, scene, simulated)
    if track is None or seen is None or row["sim_time_s"] is None:
        return row
    rollout = trial_story(spec, scene, seen, track, row, simulated)
    if request.video:
        write_film(scene.scenario.assembly, rollout.assembled, rollout.segments, request.video)
    if show is not None:
        show(rollout)
    return row


def checked_request(request: Request) -> tuple[Scenario, TrialConfig]:
    """The scenario and the settings of a request.

    Raises:
        InputError: A setting that is not allowed, two that contradict each other, or a film that cannot be written.
    """
    scenario = load_scenario(request.scenario)
    settings = requested_settings(request, scenario.clearance_mm)
    if request.video is not None:
        check_film(request.video)
    return scenario, settings


def lost_request(request: Request, spec: TrialConfig, scenario: Scenario, code: str) -> TrialRecord:
    """The row of a trial whose process died or took too long.

    Args:
        code: `worker_died` or `time_limit`.
    """
    content = content_hash(scenario, spec.scenario, find_arm(spec.arm).files)
    row = lost(spec, content, code)
    if request.observation is None:
        return row
    text = read_text(request.observation, "observation file")
    return row | {"config_hash": config_hash(spec, content, text), **MEASURED}


def _drawn(
    request: Request, spec: TrialConfig, scene: Scene, simulated: SimulatedDemonstration, watch: Any
) -> TrialRecord:
    if request.save_observation:
        from apo_bench.formats.json_forms import observation_form, write_form

        name = request.scenario if request.scenario == scene.scenario.name else str(Path(request.scenario).resolve())
        write_form(observation_form(look(spec, scene, simulated), name), request.save_observation)
    content = content_hash(scene.scenario, spec.scenario, scene.arm.files)
    return trial_row(spec, scene, simulated, content, watch=watch)
