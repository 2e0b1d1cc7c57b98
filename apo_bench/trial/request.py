"""Run a trial as a command requests it: read its options and observation file, write its film and observation."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, final

from apo_bench.assembly import Observation
from apo_bench.errors import InputError, require
from apo_bench.formats.json_forms import write_form
from apo_bench.formats.observation import read_fully_stated_observation, read_observation_file
from apo_bench.formats.observation_json import make_observation_form
from apo_bench.io import read_text
from apo_bench.records import (
    DEPTH_CAMERA,
    DETECTED,
    NOISE_LEVEL,
    TrialConfig,
    TrialRecord,
    convert_to_python_units,
    read_secret_seed,
)
from apo_bench.scenario import Scenario, find_floating_part, load_scenario
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.simulation.film.film import write_film
from apo_bench.simulation.film.track import FilmTrack
from apo_bench.simulation.graphics import renderer
from apo_bench.simulation.scene import Scene, check_film
from apo_bench.trial.fingerprint import compute_config_hash, compute_content_hash
from apo_bench.trial.keywords import expand_noise_level
from apo_bench.trial.record_start_and_end import record_lost_trial
from apo_bench.trial.rollout import Rollout, trial_story
from apo_bench.trial.run import MEASURED, noise_of, record_trial, run_measured
from apo_bench.trial.trial_stages import (
    SimulatedDemonstration,
    demonstration_failure,
    demonstration_of,
    observe_demonstration,
    scene_of,
)

Show = Callable[[Rollout], None]
"""Shows the rollout of a trial, for example in a window."""
_DRAWN = (
    *(NOISE_LEVEL.name, "noise_mm", "noise_deg", "human_error_scale", "noise", "contact_source"),
    *("pose_source", "max_reobservations", "robot_error", "seed", "secret_seed_file"),
)
"""Options without a meaning for an observation from a file, except `contact_source` with given or detected contacts."""
_MEASURED_AIR_M = 5e-3
"""Largest gap below a part in a measured start, as large as `loose_success` allows between faces."""


@final
@dataclass(frozen=True)
class Request:
    """One trial as a command requests it."""

    scenario: str
    options: Mapping[str, Any] = field(default_factory=dict)
    """Option as an argument (`noise_level`, `secret_seed_file`, ...) -> value; None stands for the default."""
    observation: Path | None = None
    """File to read the observation from instead of drawing it."""
    save_observation: Path | None = None
    """File to write the observation to."""
    video: Path | None = None
    """File to write the film to."""


def requested_settings(request: Request, clearance_mm: float) -> TrialConfig:
    """The configuration of a request.

    Args:
        clearance_mm: Default, from the scenario.

    Raises:
        InputError: A setting that is not allowed, or two that contradict each other.
    """
    options = {name: value for name, value in request.options.items() if value is not None}
    if request.observation is not None:
        _refuse_drawing(request, options)
    for name in ("noise", "noise_deg"):
        require(
            options.get("pose_source") != DEPTH_CAMERA or name not in options,
            f"{_option(name)} was given together with --pose-source depth-camera, which draws no pose noise; "
            "--noise-level is the noise of its rays in mm.",
        )
    usual: dict[str, Any] = {"scenario": request.scenario, "clearance_mm": clearance_mm}
    if "secret_seed_file" in options:
        options["secret_seed_file"] = read_secret_seed(options["secret_seed_file"])
    return TrialConfig(**(usual | convert_to_python_units(expand_noise_level(options))))


def _refuse_drawing(request: Request, options: Mapping[str, Any]) -> None:
    """Raise an `InputError` if an observation file comes with an option that draws something."""
    drawn = [name for name in _DRAWN if name in options]
    if options.get("contact_source") in ("given", *DETECTED):
        drawn.remove("contact_source")
    if request.save_observation is not None:
        drawn.append("save_observation")
    for name in drawn:
        raise InputError(
            f"{_option(name)} was given together with --observation, which draws nothing; leave one of them out."
        )


def _option(name: str) -> str:
    """The name of a setting as a command line option."""
    return "--" + name.replace("_", "-")


def load_or_draw_observation(
    scenario: str,
    path: Path | None,
    options: Mapping[str, Any],
    deviation_mm: float | None,
    deviation_deg: float | None,
) -> tuple[Observation, bool]:
    """The observation of a file, or of a drawn trial, and whether default standard deviations were assumed.

    Args:
        path: The file; None: demonstrate and observe a trial, without a replay.
        options: Settings of a drawn trial, as in `Request`.
        deviation_mm, deviation_deg: Standard deviations for a file that states none.

    Raises:
        InputError: An option of a file without a file, an option of a trial with one, or a value that is not allowed.
        RuntimeError: The demonstration itself failed in this trial.
    """
    of_file = {"deviation_mm": deviation_mm, "deviation_deg": deviation_deg}
    # Options that do not apply must be None.
    refused, reason = (of_file, "is for files") if path is None else (options, "draws a trial")
    for name, value in refused.items():
        where = "without" if path is None else "together with"
        require(
            value is None,
            f"{_option(name)}, which {reason}, was given {where} --observation; leave one of them out.",
        )
    if path is not None:
        observation, _, assumed = read_observation_file(
            path, scenario, deviation_mm=deviation_mm, deviation_deg=deviation_deg
        )
        return observation, assumed
    loaded = load_scenario(scenario)
    config = requested_settings(Request(scenario, options), loaded.clearance_mm)
    scene = scene_of(config, loaded)
    simulated = demonstration_of(config, scene)
    if simulated.demonstration.code != "ok":
        raise RuntimeError(f"{demonstration_failure(simulated.demonstration).sentence}; try another seed")
    return _observe(config, scene, simulated), False


def _observe(config: TrialConfig, scene: Scene, simulated: SimulatedDemonstration) -> Observation:
    """The observation of a trial, as the same settings always draw it."""
    noise = noise_of(config, scene, simulated)
    return observe_demonstration(simulated, noise, config.seed, config.secret_seed)


def checked_request(request: Request) -> tuple[Scenario, TrialConfig]:
    """The scenario and the configuration of a request, checked before anything is run.

    Raises:
        InputError: A setting that is not allowed, two that contradict each other, or a film that cannot be written.
    """
    scenario = load_scenario(request.scenario)
    config = requested_settings(request, scenario.clearance_mm)
    if request.video is not None:
        check_film(request.video)
    return scenario, config


def run_request(request: Request, show: Show | None = None) -> TrialRecord:
    """Run the trial, or replay the observation file, of a request.

    Args:
        show: Called with the rollout of the trial, if it was replayed.

    Raises:
        InputError: A setting that is not allowed, or two that contradict each other.
    """
    _, config = checked_request(request)
    return run_settings(request, config, show)


def run_settings(request: Request, config: TrialConfig, show: Show | None = None) -> TrialRecord:
    """Run the trial of a configuration; the request states which files to read and to write.

    Args:
        show: As in `run_request`.
    """
    scene = scene_of(config)
    track = FilmTrack() if request.video or show else None
    watch = None if track is None else track.hooks
    if request.video:
        renderer(scene.work.model, 16, 12).close()  # fails before the trial if nothing can draw
    simulated = None
    if request.observation is not None:
        observation = read_fully_stated_observation(request.observation, scene.scenario)
        aloft = find_floating_part(observation.assembly, observation.start, _MEASURED_AIR_M)
        if aloft is not None:
            raise InputError(f"{request.observation}, start, {aloft[0]}: {aloft[1]}; give the pose at which it stands.")
        text = read_text(request.observation, "observation file")
        record = run_measured(config, scene, observation, text, watch=watch)
    else:
        simulated = demonstration_of(config, scene)
        if request.save_observation is not None:
            name = request.scenario
            name = name if name == scene.scenario.name else str(Path(name).resolve())
            write_form(make_observation_form(_observe(config, scene, simulated), name), request.save_observation)
        content = compute_content_hash(scene.scenario, config.scenario, scene.arm.files)
        record = record_trial(config, scene, simulated, content, watch=watch)
    if track is None or record["sim_time_s"] is None:  # nothing was replayed, so there is nothing to show
        return record
    if simulated is not None:
        observation = _observe(config, scene, simulated)
    rollout = trial_story(config, scene, observation, track, record, simulated)
    if request.video:
        write_film(scene.scenario.assembly, rollout.assembled, rollout.segments, request.video)
    if show is not None:
        show(rollout)
    return record


def record_lost_request(request: Request, config: TrialConfig, scenario: Scenario, code: str) -> TrialRecord:
    """The record of a request whose process died (`worker_died`) or took too long (`time_limit`)."""
    content = compute_content_hash(scenario, config.scenario, find_arm(config.arm).files)
    record = record_lost_trial(config, content, code)
    if request.observation is None:
        return record
    text = read_text(request.observation, "observation file")
    return record | {"config_hash": compute_config_hash(config, content, text), **MEASURED}
