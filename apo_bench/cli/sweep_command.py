"""One command: `apo-bench sweep`, many trials out of flags or a file, resumed where they were left."""

from __future__ import annotations

import shlex
import signal
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from apo_bench.cli.arguments import cores, numbers, path_given, words
from apo_bench.errors import InputError
from apo_bench.records.limits import CORRECTOR_LIMIT_S

if TYPE_CHECKING:
    from apo_bench.sweeps.grid import SweepSpec

NOISE = "A name out of `apo-bench noise list`, FILE.toml, empirical:FILE.csv, or package.module:name"
RELATIONS = (
    "What correctors are told of the contacts: given (right), recognised, recognised-fixed (thresholds), "
    "recognised-twice, missed, false, shifted:3 (mm)"
)
EYE = "How poses are seen: noise (drawn), or range (measured in depth images; the level is mm per ray)"
FIDELITY = "full, or contact: only the part of each motion in which things may touch is simulated."
CorrectorLimit = Annotated[
    float,
    typer.Option(metavar="SECONDS", help="A corrector given as package.module:name that takes longer has failed."),
]
AXES: Mapping[str, tuple[str, Callable[[str, str], tuple[Any, ...]]]] = {
    "levels": ("levels", numbers),
    "careless": ("careless", numbers),
    "methods": ("methods", words),
    "clearance": ("clearances_mm", numbers),
    "grasp": ("grasps", words),
    "noise": ("noises", words),
    "relations": ("relations", words),
    "eye": ("eyes", words),
}
"""What a sweep has several of: option -> key of a sweep file, and how the option is read."""
KILLED = 128
"""And the number of the signal: the exit code of a process that one has ended."""


class Interrupted(Exception):
    """Asked to stop, told apart from what the command line library makes of a `KeyboardInterrupt`."""

    def __init__(self, sentence: str, code: int) -> None:
        super().__init__(sentence)
        self.code = code


def interrupted(error: KeyboardInterrupt, more: str = "") -> Interrupted:
    """What a command says that a signal has ended, with its exit code: 128 and the number of the signal."""
    number = int(getattr(error, "number", signal.SIGINT))
    said = "interrupted" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}"
    return Interrupted(f"{said}{more}.", KILLED + number)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(sweep)


def sweep(
    scenarios: Annotated[
        list[str], typer.Argument(metavar="SCENARIO... | FILE.toml", help="Names, scenario files, or one sweep file.")
    ],
    out: Annotated[
        Path,
        typer.Option(
            parser=path_given, metavar="<path>", help="Folder of the rows; one that was interrupted is continued."
        ),
    ],
    levels: Annotated[
        str | None, typer.Option(help="Noise levels, mm and degrees; default: 0,0.1,0.25,0.5,1,2,4.")
    ] = None,
    careless: Annotated[str | None, typer.Option(help="Carelessness of the human; default: 0,1.")] = None,
    methods: Annotated[
        str | None,
        typer.Option(help="oracle, none, search, correctors, any with +search; default: oracle,none,paper,contact."),
    ] = None,
    trials: Annotated[int | None, typer.Option(help="Per cell, the same seeds in every cell; default: 100.")] = None,
    seed: Annotated[int | None, typer.Option(help="First seed; default: 0.")] = None,
    salt_file: Annotated[
        Path | None,
        typer.Option(
            parser=path_given,
            metavar="<path>",
            help="Draw trials that nobody can draw without this file; made if it is not there.",
        ),
    ] = None,
    clearance: Annotated[str | None, typer.Option(help="mm per side; default: each scenario's.")] = None,
    grasp: Annotated[
        str | None, typer.Option(help="friction, or weld for an ideal gripper, or both; default: friction.")
    ] = None,
    arm: Annotated[str | None, typer.Option(help="Name of the arm, or package.module:name; default: six_axis.")] = None,
    noise: Annotated[str | None, typer.Option(help=f"{NOISE}; several with commas; default: isotropic.")] = None,
    relations: Annotated[str | None, typer.Option(help=f"{RELATIONS}; several with commas; default: given.")] = None,
    eye: Annotated[str | None, typer.Option(help=f"{EYE}; several with commas; default: noise.")] = None,
    timestep_ms: Annotated[
        float | None, typer.Option(help="Time step of the physics in ms: 1 for tables, 0.5 to check; default: 1.")
    ] = None,
    fidelity: Annotated[str | None, typer.Option(help=f"{FIDELITY} Default: full.")] = None,
    workers: Annotated[int | None, typer.Option(help="Processes; default: the cores there are.")] = None,
    trial_limit: Annotated[
        float, typer.Option(metavar="SECONDS", help="A trial that takes longer has failed.")
    ] = 600.0,
    corrector_limit: CorrectorLimit = CORRECTOR_LIMIT_S,
    backend: Annotated[str, typer.Option(help="local, or ray for a cluster.")] = "local",
    address: Annotated[str | None, typer.Option(help="Of the Ray cluster, host:port.")] = None,
) -> None:
    """Run every combination, or the grids of a file, and print success rates with Wilson 95 % intervals."""
    from apo_bench.cli.terminal import print_cells, print_prediction
    from apo_bench.statistics.rates import tally
    from apo_bench.sweeps.sweep import run_sweep

    axes = {
        "levels": levels,
        "careless": careless,
        "methods": methods,
        "clearance": clearance,
        "grasp": grasp,
        "noise": noise,
        "relations": relations,
        "eye": eye,
    }
    settings = {"trials": trials, "seed": seed, "arm": arm, "timestep_ms": timestep_ms, "fidelity": fidelity}
    grids = _grids(scenarios, axes, {name: value for name, value in settings.items() if value is not None})
    used = cores() if workers is None and backend == "local" else workers
    command = shlex.join(["apo-bench", *sys.argv[1:]])
    try:
        rows = run_sweep(
            *(grids, out),
            workers=used,
            limit_s=trial_limit,
            corrector_limit_s=corrector_limit,
            backend=backend,
            address=address,
            command=command,
            salt_file=salt_file,
        )
    except KeyboardInterrupt as error:
        raise interrupted(error, "; what had ended is kept, and the same command continues") from error
    print_cells(tally(rows))
    print_prediction(rows)
    typer.echo(
        f"{len(rows)} rows in {out / 'trials.jsonl'}; table and figure: apo-bench report {shlex.quote(str(out))}"
    )


def _grids(scenarios: list[str], axes: Mapping[str, str | None], settings: Mapping[str, Any]) -> tuple[SweepSpec, ...]:
    """The grid of the flags, or those of a sweep file with some settings replaced."""
    from apo_bench.sweeps.grid import SweepSpec
    from apo_bench.sweeps.sweep_file import is_sweep_file, read_sweep

    given = {option: text for option, text in axes.items() if text is not None}
    files = [name for name in scenarios if is_sweep_file(name)]
    if not files:
        several: dict[str, Any] = {
            AXES[option][0]: AXES[option][1](text, f"--{option}") for option, text in given.items()
        }
        alone = {name: value for name, value in settings.items() if name != "timestep_ms"}
        step = {"timestep_s": settings["timestep_ms"] * 1e-3} if "timestep_ms" in settings else {}
        return (SweepSpec(tuple(scenarios), **several, **alone, **step),)
    if len(scenarios) > 1:
        raise InputError(
            f"the sweep file {files[0]} was given together with {len(scenarios) - 1} more; name scenarios in the file, "
            "and run one file at a time."
        )
    for option in given:
        raise InputError(
            f"--{option} was given together with the sweep file {files[0]}; write {AXES[option][0]} into the file."
        )
    return read_sweep(files[0], settings)
