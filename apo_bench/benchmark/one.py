"""One trial by hand: from what was asked for on the command line to its row, a film, a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

from apo_bench.benchmark.recognised import KINDS as RECOGNISED
from apo_bench.benchmark.spec import RANGE, TrialSpec, check_clearance
from apo_bench.benchmark.stages import Shown, misshown, see, show
from apo_bench.benchmark.trial import Row, eye_of, run_measured, run_trial
from apo_bench.errors import InputError
from apo_bench.files import observation_form, write_form
from apo_bench.observed import read_observation, read_stated
from apo_bench.program import Observation
from apo_bench.scenario_file import load_scenario
from apo_bench.simulation.scene import Scene, build_scene


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
    method: str = "none"
    clearance_mm: float | None = None
    grasp: str = "friction"
    arm: str = "six_axis"
    timestep_s: float = 0.001
    observation: Path | None = None
    save_observation: Path | None = None
    video: Path | None = None


def run_one(request: Request) -> Row:
    """Run the trial, or the replay of a measured observation, that was asked for.

    Raises:
        InputError: A setting that is not allowed, or two that contradict each other.
    """
    scenario = load_scenario(request.scenario)
    spec = _spec(request, scenario.clearance_mm)
    scene = build_scene(
        scenario,
        clearance_mm=spec.clearance_mm,
        grasp=spec.grasp,
        arm=spec.arm,
        timestep_s=spec.timestep_s,
    )
    film = _film(scene) if request.video else None
    if request.observation:
        row = _measured(request.observation, spec, scene, film)
    else:
        row = _drawn(request, spec, scene, film)
    if film is not None and row["sim_seconds"] is not None:
        film.save(request.video)
    return row


def watched(request: Request) -> Observation:
    """What is seen of the trial, or read from the file, that was asked for; nothing is replayed.

    Raises:
        InputError: A setting that is not allowed, or two that contradict each other.
        RuntimeError: The demonstration itself failed.
    """
    scenario = load_scenario(request.scenario)
    spec = _spec(request, scenario.clearance_mm)
    if request.observation:
        return read_observation(request.observation, scenario)
    scene = build_scene(scenario, clearance_mm=spec.clearance_mm, grasp=spec.grasp, arm=spec.arm)
    shown = show(scene, spec.careless, spec.seed, spec.eye)
    if shown.demonstration.code != "ok":
        raise RuntimeError(f"{misshown(shown.demonstration).sentence}; try another seed")
    return look(spec, scene, shown)


def look(spec: TrialSpec, scene: Scene, shown: Shown) -> Observation:
    """The demonstration of a trial through its eye."""
    return see(scene, shown, eye_of(spec, scene, shown), spec.seed)


def _drawn(request: Request, spec: TrialSpec, scene: Scene, film: Any) -> Row:
    shown = show(scene, spec.careless, spec.seed, spec.eye)
    if request.save_observation:
        name = request.scenario if request.scenario == scene.scenario.name else str(Path(request.scenario).resolve())
        write_form(observation_form(look(spec, scene, shown), name), request.save_observation)
    return run_trial(spec, scene, shown=shown, watch=film)


def _measured(path: Path, spec: TrialSpec, scene: Scene, film: Any) -> Row:
    seen = read_stated(path, scene.scenario)
    return run_measured(spec, scene, seen, path.read_text(encoding="utf-8"), watch=film)


def _spec(request: Request, clearance_mm: float) -> TrialSpec:
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
    return TrialSpec(
        scenario=request.scenario,
        level_mm=level if request.level_mm is None else request.level_mm,
        level_deg=level if request.level_deg is None else request.level_deg,
        careless=1.0 if request.careless is None else request.careless,
        clearance_mm=clearance_mm if request.clearance_mm is None else request.clearance_mm,
        noise=request.noise or "isotropic",
        grasp=request.grasp,
        arm=request.arm,
        method=request.method,
        seed=0 if request.seed is None else request.seed,
        timestep_s=request.timestep_s,
        relations=request.relations or "given",
        eye=request.eye or "noise",
    )


def _refuse_contradictions(request: Request) -> None:
    """Nothing is drawn for an observation that comes from a file, but its contacts may be recognised."""
    for name in ("level", "level_mm", "level_deg", "careless", "noise", "relations", "eye", "seed", "save_observation"):
        allowed = name == "relations" and request.relations in ("given", *RECOGNISED)
        if getattr(request, name) is not None and not allowed:
            option = "--" + name.replace("_", "-")
            raise InputError(
                f"{option} was given together with --observation, which draws nothing; leave one of them out."
            )


def _film(scene: Scene) -> Any:
    from apo_bench.simulation.render import Film

    return Film(scene)
