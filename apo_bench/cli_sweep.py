"""One command: `apo-bench sweep`, many trials, resumed where they were left."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from apo_bench.arguments import cores, numbers, path_given, words

NOISE = "A name out of `apo-bench noise list`, FILE.toml, empirical:FILE.csv, or package.module:name"
RELATIONS = (
    "What correctors are told of the contacts: given (right), recognised, recognised-fixed (thresholds), "
    "recognised-twice, missed, false, shifted:3 (mm)"
)
EYE = "How poses are seen: noise (drawn), or range (measured in depth images; the level is mm per ray)"
FIDELITY = "full, or contact: only the part of each motion in which things may touch is simulated."


class Interrupted(Exception):
    """Ctrl-C, told apart from what the command line library makes of a `KeyboardInterrupt`."""


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(sweep)


def sweep(
    scenarios: Annotated[list[str], typer.Argument(metavar="SCENARIO...", help="Names, or scenario files.")],
    out: Annotated[
        Path,
        typer.Option(
            parser=path_given, metavar="<path>", help="Folder of the rows; one that was interrupted is continued."
        ),
    ],
    levels: Annotated[str, typer.Option(help="Noise levels, mm and degrees.")] = "0,0.1,0.25,0.5,1,2,4",
    careless: Annotated[str, typer.Option(help="Carelessness of the human.")] = "0,1",
    methods: Annotated[str, typer.Option(help="oracle, none and correctors.")] = "oracle,none,paper,contact",
    trials: Annotated[int, typer.Option(help="Trials per cell; the same seeds in every cell.")] = 100,
    seed: Annotated[int, typer.Option(help="First seed.")] = 0,
    clearance: Annotated[str | None, typer.Option(help="mm per side; default: each scenario's.")] = None,
    grasp: Annotated[str, typer.Option(help="friction, or weld for an ideal gripper; both with a comma.")] = "friction",
    arm: Annotated[str, typer.Option(help="Name of the arm, or package.module:name.")] = "six_axis",
    noise: Annotated[str | None, typer.Option(help=f"{NOISE}; several with commas; default: isotropic.")] = None,
    relations: Annotated[str, typer.Option(help=f"{RELATIONS}; several with commas.")] = "given",
    eye: Annotated[str, typer.Option(help=f"{EYE}; several with commas.")] = "noise",
    timestep_ms: Annotated[float, typer.Option(help="Time step of the physics in ms: 1 for tables.")] = 1.0,
    fidelity: Annotated[str, typer.Option(help=FIDELITY)] = "full",
    workers: Annotated[int | None, typer.Option(help="Processes; default: the cores there are.")] = None,
) -> None:
    """Run every combination and print success rates with Wilson 95 % intervals."""
    from apo_bench.benchmark import sweep as runner
    from apo_bench.benchmark.grid import SweepSpec
    from apo_bench.benchmark.statistics import tally
    from apo_bench.benchmark.terminal import print_cells, print_prediction

    spec = SweepSpec(
        scenarios=tuple(scenarios),
        levels=numbers(levels, "--levels"),
        careless=numbers(careless, "--careless"),
        methods=words(methods, "--methods"),
        clearances_mm=() if clearance is None else numbers(clearance, "--clearance"),
        trials=trials,
        seed=seed,
        noises=() if noise is None else words(noise, "--noise"),
        relations=words(relations, "--relations"),
        eyes=words(eye, "--eye"),
        grasps=words(grasp, "--grasp"),
        arm=arm,
        timestep_s=timestep_ms * 1e-3,
        fidelity=fidelity,
    )
    command = shlex.join(["apo-bench", *sys.argv[1:]])
    try:
        rows = runner.sweep(spec, out, workers=cores() if workers is None else workers, command=command)
    except KeyboardInterrupt as error:
        raise Interrupted("interrupted; what had ended is kept, and the same command continues.") from error
    print_cells(tally(rows))
    print_prediction(rows)
    typer.echo(
        f"{len(rows)} rows in {out / 'trials.jsonl'}; table and figure: apo-bench report {shlex.quote(str(out))}"
    )
