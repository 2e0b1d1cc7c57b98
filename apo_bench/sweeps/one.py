"""One trial by hand: from what was asked for on the command line to its row, a film, a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, final

from apo_bench.assembly.goals import Observation
from apo_bench.correction.own_code.own import OwnCorrectors
from apo_bench.errors import InputError
from apo_bench.files.json_forms import observation_form, write_form
from apo_bench.files.observation import read_observation_file, read_stated
from apo_bench.io.reading import read_text
from apo_bench.records.limits import CORRECTOR_LIMIT_S
from apo_bench.records.method import parsed
from apo_bench.records.relations import RECOGNISED
from apo_bench.records.row import Row
from apo_bench.records.salt import read_salt
from apo_bench.records.settings import METHOD, RANGE, TrialSettings, check_clearance
from apo_bench.scenario.file import load_scenario
from apo_bench.scenario.scenario import Scenario
from apo_bench.scenario.starts import in_the_air
from apo_bench.simulation.scene.arm import find_arm
from apo_bench.simulation.scene.scene import Scene, build_scene
from apo_bench.sweeps.local.alone import Say, run_alone
from apo_bench.sweeps.worker import lost, row_of
from apo_bench.trial.fingerprint import content_hash, spec_hash
from apo_bench.trial.stages import Recording, demonstration_failure, observe_recording, record_demonstration
from apo_bench.trial.trial import MEASURED, noise_of, run_measured, scene_of

MEASURED_AIR_M = 5e-3
"""A start that was measured may be wrong by so much: as far apart as `loose_success` lets faces be."""


@final
@dataclass(frozen=True)
class Request:
    """One replay; None stands for the default."""

    scenario: str
    level: float | None = None
    level_mm: float | None = None
    level_deg: float | None = None
    careless: float | None = None
    noise: str | None = None
    relations: str | None = None
    eye: str | None = None
    seed: int | None = None
    salt_file: Path | None = None
    method: str = METHOD
    clearance_mm: float | None = None
    grasp: str = "friction"
    arm: str = "six_axis"
    timestep_s: float = 0.001
    fidelity: str = "full"
    observation: Path | None = None
    save_observation: Path | None = None
    video: Path | None = None
    corrector_limit_s: float = CORRECTOR_LIMIT_S
    """Wall time that a corrector named as `module:name` may take."""
    limit_s: float | None = None
    """Wall time; what has one runs in a process of its own, as in a sweep."""


def run_one(request: Request) -> Row:
    """Run the trial, or the replay of a measured observation, that was asked for.

    Raises:
        InputError: A setting that is not allowed, or two that contradict each other.
    """
    scenario = load_scenario(request.scenario)
    spec = _spec(request, scenario.clearance_mm)
    if request.limit_s is not None:
        return run_alone(partial(_run, request, spec), request.limit_s, partial(_lost, request, spec, scenario))
    found: list[Row] = []
    _run(request, spec, lambda kind, *news: found.extend(news))
    return found[0]


def _run(request: Request, spec: TrialSettings, say: Say) -> None:
    """Run it and say its row, then write the film."""
    with OwnCorrectors(request.corrector_limit_s) as own:
        _run_by(own.find(parsed(spec.method).plan), request, spec, say)


def _run_by(method: Any, request: Request, spec: TrialSettings, say: Say) -> None:
    scene = scene_of(spec)
    film = _film(scene) if request.video else None
    say("began")
    if request.observation:
        row = _measured(request.observation, spec, scene, method, film)
    else:
        row = _drawn(request, spec, scene, method, film)
    say("row", row)
    if film is not None and row["sim_seconds"] is not None:
        film.save(request.video)


def _lost(request: Request, spec: TrialSettings, scenario: Scenario, code: str) -> Row:
    """The row of a trial whose process died or took too long."""
    content = content_hash(scenario, spec.scenario, find_arm(spec.arm).mjcf)
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
        asked: What only a trial knows: level, seed, noise and so on, as in `Request`; None stands for the default.
        deviations: What only a file may need: `deviation_mm` and `deviation_deg`.

    Raises:
        InputError: One of the two was given with the other, or something is not allowed.
    """
    refused, reason = (deviations, "is for files") if observation is None else (asked, "draws a trial")
    for name, value in refused.items():
        if value is not None:
            option, where = "--" + name.replace("_", "-"), "without" if observation is None else "together with"
            raise InputError(f"{option}, which {reason}, was given {where} --observation; leave one of them out.")
    if observation is None:
        return watched(Request(scenario=scenario, **asked)), False
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
    scene = build_scene(scenario, clearance_mm=spec.clearance_mm, grasp=spec.grasp, arm=spec.arm)
    shown = record_demonstration(scene, spec.careless, spec.seed, spec.eye, spec.salt)
    if shown.demonstration.code != "ok":
        raise RuntimeError(f"{demonstration_failure(shown.demonstration).sentence}; try another seed")
    return look(spec, scene, shown)


def look(spec: TrialSettings, scene: Scene, shown: Recording) -> Observation:
    """The demonstration of a trial through its eye."""
    return observe_recording(shown, noise_of(spec, scene, shown), spec.seed, spec.salt)


def _drawn(request: Request, spec: TrialSettings, scene: Scene, method: Any, film: Any) -> Row:
    shown = record_demonstration(scene, spec.careless, spec.seed, spec.eye, spec.salt)
    if request.save_observation:
        name = request.scenario if request.scenario == scene.scenario.name else str(Path(request.scenario).resolve())
        write_form(observation_form(look(spec, scene, shown), name), request.save_observation)
    content = content_hash(scene.scenario, spec.scenario, scene.arm.mjcf)
    return row_of(spec, scene, shown, content, method=method, watch=film)


def _measured(path: Path, spec: TrialSettings, scene: Scene, method: Any, film: Any) -> Row:
    seen = read_stated(path, scene.scenario)
    aloft = in_the_air(seen.assembly, seen.start, MEASURED_AIR_M)
    if aloft is not None:
        raise InputError(f"{path}, start, {aloft[0]}: {aloft[1]}; give the pose at which it stands.")
    return run_measured(spec, scene, seen, read_text(path, "observation file"), method=method, watch=film)


def _spec(request: Request, clearance_mm: float) -> TrialSettings:
    if request.observation:
        _refuse_contradictions(request)
    for name in ("noise", "level_deg"):
        if request.eye == RANGE and getattr(request, name) is not None:
            raise InputError(
                f"--{name.replace('_', '-')} was given together with --eye range, which draws no pose noise; "
                "--level is the noise of its rays in mm."
            )
    if request.clearance_mm is not None:
        check_clearance(request.clearance_mm)
    level = 1.0 if request.level is None else request.level
    return TrialSettings(
        scenario=request.scenario,
        level_mm=level if request.level_mm is None else request.level_mm,
        level_deg=level if request.level_deg is None else request.level_deg,
        careless=1.0 if request.careless is None else request.careless,
        clearance_mm=clearance_mm if request.clearance_mm is None else request.clearance_mm,
        noise="isotropic" if request.noise is None else request.noise,
        grasp=request.grasp,
        arm=request.arm,
        method=request.method,
        seed=0 if request.seed is None else request.seed,
        timestep_s=request.timestep_s,
        relations="given" if request.relations is None else request.relations,
        eye="noise" if request.eye is None else request.eye,
        fidelity=request.fidelity,
        salt=None if request.salt_file is None else read_salt(request.salt_file),
    )


def _refuse_contradictions(request: Request) -> None:
    """Nothing is drawn for an observation that comes from a file, but its contacts may be recognised."""
    drawn = ("level", "level_mm", "level_deg", "careless", "noise", "relations", "eye", "seed", "salt_file")
    for name in (*drawn, "save_observation"):
        allowed = name == "relations" and request.relations in ("given", *RECOGNISED)
        if getattr(request, name) is not None and not allowed:
            option = "--" + name.replace("_", "-")
            raise InputError(
                f"{option} was given together with --observation, which draws nothing; leave one of them out."
            )


def _film(scene: Scene) -> Any:
    from apo_bench.simulation.scene.render import Film

    return Film(scene)
