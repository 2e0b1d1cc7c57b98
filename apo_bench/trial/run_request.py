"""One trial from what was asked for to its row, a film, a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from apo_bench.assembly.goals import Observation
from apo_bench.correction.own_code.own import OwnCorrectors
from apo_bench.errors import InputError
from apo_bench.io.reading import read_text
from apo_bench.records.method import parsed
from apo_bench.records.row import Row
from apo_bench.records.settings import TrialSettings
from apo_bench.scenario.file import load_scenario
from apo_bench.scenario.scenario import Scenario
from apo_bench.scenario.starts import in_the_air
from apo_bench.simulation.arms.finding import find_arm
from apo_bench.simulation.film.film import write_film
from apo_bench.simulation.film.still import FilmTrack
from apo_bench.simulation.scene.graphics import renderer
from apo_bench.simulation.scene.scene import Scene
from apo_bench.trial.fingerprint import content_hash, spec_hash
from apo_bench.trial.kept_demonstrations import KeptDemonstrations, demonstration_of
from apo_bench.trial.request import Request, look, requested_settings
from apo_bench.trial.row import lost
from apo_bench.trial.scene import scene_of
from apo_bench.trial.stages import SimulatedDemonstration
from apo_bench.trial.story import Story, trial_story
from apo_bench.trial.trial import MEASURED, run_measured, trial_row

Say = Callable[..., None]
Show = Callable[[Story], None]

MEASURED_AIR_M = 5e-3
"""A start that was measured may be wrong by so much: as far apart as `loose_success` lets faces be."""


def run_request(request: Request, show: Show | None = None) -> Row:
    """Run the trial, or the replay of a measured observation, that was asked for.

    Args:
        show: Called with what is to be seen of the trial, if anything was replayed.

    Raises:
        InputError: A setting that is not allowed, or two that contradict each other.
    """
    _, settings = checked_request(request)
    rows: list[Row] = []
    work_on(request, settings, lambda kind, *news: rows.extend(news), show)
    return rows[0]


def checked_request(request: Request) -> tuple[Scenario, TrialSettings]:
    """The scenario and the settings of a request.

    Raises:
        InputError: A setting that is not allowed, two that contradict each other, or no place for demonstrations.
    """
    scenario = load_scenario(request.scenario)
    settings = requested_settings(request, scenario.clearance_mm)
    if request.cache is not None:
        KeptDemonstrations(request.cache)
    return scenario, settings


def work_on(request: Request, spec: TrialSettings, say: Say, show: Show | None = None) -> None:
    """Run what was asked for and say its row, then write the film.

    Args:
        say: Told "began" when the time of the trial begins to count, and "row" with the row when it ends.
        show: Called with what is to be seen of the trial, if anything was replayed.
    """
    with OwnCorrectors(request.corrector_limit_s) as own:
        _run_by(own.find(parsed(spec.method).plan), request, spec, say, show)


def _run_by(method: Any, request: Request, spec: TrialSettings, say: Say, show: Show | None) -> None:
    scene = scene_of(spec)
    simulated = None
    track = FilmTrack() if request.video or show else None
    watch = None if track is None else track.hooks
    if request.video:
        renderer(scene.work.model, 16, 12).close()  # is there anything to draw with? asked before the trial is run
    say("began")
    seen: Observation | None = None
    if request.observation:
        from apo_bench.files.observation import read_stated

        seen = read_stated(request.observation, scene.scenario)
        row = _measured(request.observation, seen, spec, scene, method, watch)
    else:
        simulated = demonstration_of(spec, scene, KeptDemonstrations(request.cache) if request.cache else None)
        row = _drawn(request, spec, scene, simulated, method, watch)
        if track is not None and row["sim_seconds"] is not None:
            seen = look(spec, scene, simulated)
    say("row", row)
    if track is None or seen is None or row["sim_seconds"] is None:
        return
    story = trial_story(spec, scene, seen, track, row, simulated)
    if request.video:
        write_film(scene.scenario.assembly, story.assembled, story.chapters, request.video)
    if show is not None:
        show(story)


def lost_request(request: Request, spec: TrialSettings, scenario: Scenario, code: str) -> Row:
    """The row of a trial whose process died or took too long.

    Args:
        code: `worker_died` or `time_limit`.
    """
    content = content_hash(scenario, spec.scenario, find_arm(spec.arm).files)
    row = lost(spec, content, code)
    if request.observation is None:
        return row
    text = read_text(request.observation, "observation file")
    return row | {"spec_hash": spec_hash(spec, content, text), **MEASURED}


def _drawn(
    request: Request, spec: TrialSettings, scene: Scene, simulated: SimulatedDemonstration, method: Any, watch: Any
) -> Row:
    if request.save_observation:
        from apo_bench.files.json_forms import observation_form, write_form

        name = request.scenario if request.scenario == scene.scenario.name else str(Path(request.scenario).resolve())
        write_form(observation_form(look(spec, scene, simulated), name), request.save_observation)
    content = content_hash(scene.scenario, spec.scenario, scene.arm.files)
    return trial_row(spec, scene, simulated, content, method=method, watch=watch)


def _measured(path: Path, observation: Observation, spec: TrialSettings, scene: Scene, method: Any, watch: Any) -> Row:
    aloft = in_the_air(observation.assembly, observation.start, MEASURED_AIR_M)
    if aloft is not None:
        raise InputError(f"{path}, start, {aloft[0]}: {aloft[1]}; give the pose at which it stands.")
    return run_measured(spec, scene, observation, read_text(path, "observation file"), method=method, watch=watch)
