"""One command: `apo-bench replay`, a trial with all that can be told of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from apo_bench.cli.arguments import check_writable, path_given
from apo_bench.cli.sweep_command import EYE, FIDELITY, NOISE, RELATIONS, CorrectorLimit, interrupted
from apo_bench.io.output import redirect_output
from apo_bench.records.limits import CORRECTOR_LIMIT_S

NO_RESULT = 1
ScenarioArgument = Annotated[str, typer.Argument(help="A name out of `apo-bench scenarios`, or a scenario file.")]
Clearance = Annotated[float | None, typer.Option(help="mm per side of parts that fit; default: the scenario's.")]
GraspOption = Annotated[str, typer.Option(help="friction, or weld for an ideal gripper.")]
ArmOption = Annotated[str, typer.Option(help="Name of the arm, or package.module:name.")]
Timestep = Annotated[float, typer.Option(help="Time step of the physics in ms: 1 for tables, 0.5 to check.")]


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(replay)


def replay(
    scenario: ScenarioArgument,
    level: Annotated[float | None, typer.Option(help="Noise: mm and degrees, standard deviation; default 1.")] = None,
    level_mm: Annotated[float | None, typer.Option(help="Only the mm; default: the level.")] = None,
    level_deg: Annotated[float | None, typer.Option(help="Only the degrees; default: the level.")] = None,
    careless: Annotated[float | None, typer.Option(help="0 is a careful human; default 1.")] = None,
    seed: Annotated[int | None, typer.Option(help="Number of the trial; default 0.")] = None,
    salt_file: Annotated[
        Path | None,
        typer.Option(parser=path_given, metavar="<path>", help="The salt of the sweep that the trial is of."),
    ] = None,
    method: Annotated[
        str, typer.Option(help="oracle, none, search, a corrector or package.module:name; +search after one.")
    ] = "contact",
    clearance: Clearance = None,
    grasp: GraspOption = "friction",
    arm: ArmOption = "six_axis",
    noise: Annotated[str | None, typer.Option(help=f"{NOISE}; default: isotropic.")] = None,
    relations: Annotated[str | None, typer.Option(help=f"{RELATIONS}; default: given.")] = None,
    eye: Annotated[str | None, typer.Option(help=f"{EYE}; default: noise.")] = None,
    timestep_ms: Timestep = 1.0,
    fidelity: Annotated[str, typer.Option(help=FIDELITY)] = "full",
    observation: Annotated[Path | None, typer.Option(help="Replay this observation file instead.")] = None,
    save_observation: Annotated[Path | None, typer.Option(help="Write what was seen to this JSON file.")] = None,
    video: Annotated[Path | None, typer.Option(help="Write a film of the replay: .mp4 or .gif.")] = None,
    trial_limit: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="Run it in a process of its own, as sweeps do: ended then.")
    ] = None,
    corrector_limit: CorrectorLimit = CORRECTOR_LIMIT_S,
    as_json: Annotated[bool, typer.Option("--json", help="Print the row, one JSON object, and nothing else.")] = False,
) -> None:
    """Run one trial: demonstrate, observe, plan by a method, replay, judge."""
    from apo_bench.cli.terminal import print_row
    from apo_bench.sweeps.one import Request, run_one

    for path, option, endings in (
        (video, "--video", (".mp4", ".gif")),
        (save_observation, "--save-observation", (".json",)),
    ):
        if path is not None:
            check_writable(path, option, endings)
    request = Request(
        scenario=scenario,
        level=level,
        level_mm=level_mm,
        level_deg=level_deg,
        careless=careless,
        noise=noise,
        relations=relations,
        eye=eye,
        seed=seed,
        salt_file=salt_file,
        method=method,
        clearance_mm=clearance,
        grasp=grasp,
        arm=arm,
        timestep_s=timestep_ms * 1e-3,
        fidelity=fidelity,
        observation=observation,
        save_observation=save_observation,
        video=video,
        limit_s=trial_limit,
        corrector_limit_s=corrector_limit,
    )
    try:
        with redirect_output(as_json):
            row = run_one(request)
    except KeyboardInterrupt as error:
        raise interrupted(error) from error
    if as_json:
        typer.echo(json.dumps(row, allow_nan=False))
    else:
        print_row(row)
    if video is not None and row["sim_seconds"] is None:
        typer.echo(f"apo-bench: nothing was replayed, so {video} was not written.", err=True)
    if row["success"] is None:
        raise typer.Exit(NO_RESULT)
