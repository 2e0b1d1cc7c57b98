"""One trial by hand: from what was asked for on the command line to its row, a film, a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

from apo_bench.assembly.goals import Observation
from apo_bench.correction.own_code.own import OwnCorrectors
from apo_bench.errors import InputError
from apo_bench.io.reading import read_text
from apo_bench.records.asked import in_python
from apo_bench.records.limits import CORRECTOR_LIMIT_S
from apo_bench.records.method import parsed
from apo_bench.records.relations import RECOGNISED
from apo_bench.records.row import Row
from apo_bench.records.salt import read_salt
from apo_bench.records.settings import LEVEL, RANGE, TrialSettings
from apo_bench.scenario.file import load_scenario
from apo_bench.scenario.scenario import Scenario
from apo_bench.scenario.starts import in_the_air
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.simulation.film.film import write_film
from apo_bench.simulation.film.track import ReplayTrack
from apo_bench.simulation.scene.graphics import renderer
from apo_bench.simulation.scene.scene import Scene
from apo_bench.sweeps.worker import lost, trial_row
from apo_bench.trial.fingerprint import content_hash, spec_hash
from apo_bench.trial.kept_demonstrations import KeptDemonstrations
from apo_bench.trial.scene import scene_of
from apo_bench.trial.stages import Recording, demonstration_failure, observe_recording, record_demonstration
from apo_bench.trial.story import Story, told
from apo_bench.trial.trial import MEASURED, noise_of, run_measured

if TYPE_CHECKING:
    from apo_bench.sweeps.local.alone import Say

Show = Callable[[Story], None]

MEASURED_AIR_M = 5e-3
"""A start that was measured may be wrong by so much: as far apart as `loose_success` lets faces be."""


@final
@dataclass(frozen=True)
class Request:
    """One replay."""

    scenario: str
    asked: Mapping[str, Any] = field(default_factory=dict)
    """Option as an argument (`level`, `clearance`, `salt_file`, ...) -> value; what is not there or None is as usual.
    """
    observation: Path | None = None
    save_observation: Path | None = None
    video: Path | None = None
    corrector_limit_s: float = CORRECTOR_LIMIT_S
    """Wall time that a corrector named as `module:name` may take."""
    limit_s: float | None = None
    """Wall time; what has one runs in a process of its own, as in a sweep."""
    cache: Path | None = None
    """A folder where demonstrations are kept; the row is the same with and without it."""


def run_one(request: Request, show: Show | None = None) -> Row:
    """Run the trial, or the replay of a measured observation, that was asked for.

    Args:
        show: Called with what is to be seen of the trial, if anything was replayed.

    Raises:
        InputError: A setting that is not allowed, or two that contradict each other.
    """
    scenario = load_scenario(request.scenario)
    spec = _spec(request, scenario.clearance_mm)
    if request.cache is not None:
        KeptDemonstrations(request.cache)
    if request.limit_s is not None:
        if show is not None:
            raise InputError("--view was given together with --trial-limit; leave one of them out.")
        from apo_bench.sweeps.local.alone import run_alone

        return run_alone(partial(_run, request, spec), request.limit_s, partial(_lost, request, spec, scenario))
    found: list[Row] = []
    _run(request, spec, lambda kind, *news: found.extend(news), show)
    return found[0]


def _run(request: Request, spec: TrialSettings, say: Say, show: Show | None = None) -> None:
    """Run it and say its row, then write the film."""
    with OwnCorrectors(request.corrector_limit_s) as own:
        _run_by(own.find(parsed(spec.method).plan), request, spec, say, show)


def _run_by(method: Any, request: Request, spec: TrialSettings, say: Say, show: Show | None) -> None:
    scene, recording = scene_of(spec), None
    track = ReplayTrack() if request.video or show else None
    if request.video:
        renderer(scene.work.model, 16, 12).close()  # is there anything to draw with? asked before the trial is run
    say("began")
    seen: Observation | None = None
    if request.observation:
        from apo_bench.files.observation import read_stated

        seen = read_stated(request.observation, scene.scenario)
        row = _measured(request.observation, seen, spec, scene, method, track)
    else:
        recording = _recording(request, spec, scene)
        row = _drawn(request, spec, scene, recording, method, track)
        if track is not None and row["sim_seconds"] is not None:
            seen = look(spec, scene, recording)
    say("row", row)
    if track is None or seen is None or row["sim_seconds"] is None:
        return
    story = told(spec, scene, seen, track, row, recording)
    if request.video:
        write_film(scene.scenario.assembly, story.assembled, story.chapters, request.video)
    if show is not None:
        show(story)


def _lost(request: Request, spec: TrialSettings, scenario: Scenario, code: str) -> Row:
    """The row of a trial whose process died or took too long."""
    content = content_hash(scenario, spec.scenario, find_arm(spec.arm).files)
    row = lost(spec, content, code)
    if request.observation is None:
        return row
    text = read_text(request.observation, "observation file")
    return row | {"spec_hash": spec_hash(spec, content, text), **MEASURED}


def looked_at(
    scenario: str,
    observation: Path | None,
    asked: Mapping[str, Any],
    deviations: Mapping[str, float | None],
) -> tuple[Observation, bool]:
    """What is seen of a trial, or stands in a file, and whether standard deviations had to be assumed.

    Args:
        asked: What only a trial knows: level, seed, noise and so on, as in `Request`.
        deviations: What only a file may need: `deviation_mm` and `deviation_deg`.

    Raises:
        InputError: One of the two was given with the other, or something is not allowed.
    """
    refused, reason = (deviations, "is for files") if observation is None else (asked, "draws a trial")
    for name, value in refused.items():
        if value is not None:
            where = "without" if observation is None else "together with"
            raise InputError(
                f"{_option(name)}, which {reason}, was given {where} --observation; leave one of them out."
            )
    if observation is None:
        return watched(Request(scenario, asked)), False
    from apo_bench.files.observation import read_observation_file

    stated = {name: value for name, value in deviations.items() if value is not None}
    seen, _, assumed = read_observation_file(observation, scenario, **stated)
    return seen, assumed


def watched(request: Request) -> Observation:
    """What is seen of the trial that was asked for; nothing is replayed.

    Raises:
        InputError: A setting that is not allowed, or two that contradict each other.
        RuntimeError: The demonstration itself failed.
    """
    scenario = load_scenario(request.scenario)
    spec = _spec(request, scenario.clearance_mm)
    scene = scene_of(spec, scenario)
    recording = record_demonstration(scene, spec.careless, spec.seed, spec.eye, spec.salt)
    if recording.demonstration.code != "ok":
        raise RuntimeError(f"{demonstration_failure(recording.demonstration).sentence}; try another seed")
    return look(spec, scene, recording)


def look(spec: TrialSettings, scene: Scene, recording: Recording) -> Observation:
    """The demonstration of a trial through its eye."""
    return observe_recording(recording, noise_of(spec, scene, recording), spec.seed, spec.salt)


def _recording(request: Request, spec: TrialSettings, scene: Scene) -> Recording:
    if request.cache is None:
        return record_demonstration(scene, spec.careless, spec.seed, spec.eye, spec.salt)
    return KeptDemonstrations(request.cache).recording(spec, scene)


def _drawn(request: Request, spec: TrialSettings, scene: Scene, recording: Recording, method: Any, watch: Any) -> Row:
    if request.save_observation:
        from apo_bench.files.json_forms import observation_form, write_form

        name = request.scenario if request.scenario == scene.scenario.name else str(Path(request.scenario).resolve())
        write_form(observation_form(look(spec, scene, recording), name), request.save_observation)
    content = content_hash(scene.scenario, spec.scenario, scene.arm.files)
    return trial_row(spec, scene, recording, content, method=method, watch=watch)


def _measured(path: Path, observation: Observation, spec: TrialSettings, scene: Scene, method: Any, watch: Any) -> Row:
    aloft = in_the_air(observation.assembly, observation.start, MEASURED_AIR_M)
    if aloft is not None:
        raise InputError(f"{path}, start, {aloft[0]}: {aloft[1]}; give the pose at which it stands.")
    return run_measured(spec, scene, observation, read_text(path, "observation file"), method=method, watch=watch)


def _spec(request: Request, clearance_mm: float) -> TrialSettings:
    asked = {name: value for name, value in request.asked.items() if value is not None}
    if request.observation:
        _refuse_contradictions(request, asked)
    for name in ("noise", "level_deg"):
        if asked.get("eye") == RANGE and name in asked:
            raise InputError(
                f"{_option(name)} was given together with --eye range, which draws no pose noise; "
                "--level is the noise of its rays in mm."
            )
    usual: dict[str, Any] = {"scenario": request.scenario, "clearance_mm": clearance_mm}
    if "level" in asked:
        usual |= dict.fromkeys(("level_mm", "level_deg"), asked.pop("level"))
    if "salt_file" in asked:
        asked["salt_file"] = read_salt(asked["salt_file"])
    return TrialSettings(**(usual | in_python(asked)))


DRAWN = (
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


def _refuse_contradictions(request: Request, asked: Mapping[str, Any]) -> None:
    may_be = asked.get("relations") in ("given", *RECOGNISED)
    given = [name for name in DRAWN if name in asked and not (name == "relations" and may_be)]
    more = [name for name in ("save_observation", "cache") if getattr(request, name) is not None]
    for name in (*given, *more):
        raise InputError(
            f"{_option(name)} was given together with --observation, which draws nothing; leave one of them out."
        )


def _option(name: str) -> str:
    return "--" + name.replace("_", "-")
