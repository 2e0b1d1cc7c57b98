"""One command: `apo-bench sweep`, many trials out of flags or a file, resumed where they were left.

The command `apo-bench dataset make`: whole trials as tables to learn from.
"""

from __future__ import annotations

import shlex
import signal
import sys
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from apo_bench.cli.arguments import ScenarioArgument
from apo_bench.cli.completion import completion
from apo_bench.cli.cores import cores
from apo_bench.cli.help import group
from apo_bench.cli.outputs import writing
from apo_bench.cli.setting_options import read_axis, sweep_options, takes, trial_options
from apo_bench.cli.values import path_given
from apo_bench.errors import InputError, require
from apo_bench.records import FIRST_TRAINING_TRIAL, SETTINGS, in_python
from apo_bench.scenario.file import load_scenario

if TYPE_CHECKING:
    from apo_bench.benchmark.sweeps.grid import SweepConfig

_KILLED = 128
"""Added to the number of a signal: the exit code of a process that it has ended."""


class Interrupted(Exception):
    """Asked to stop, told apart from what the command line library makes of a `KeyboardInterrupt`."""

    def __init__(self, sentence: str, code: int) -> None:
        super().__init__(sentence)
        self.code = code


def interrupted(error: KeyboardInterrupt, more: str = "") -> Interrupted:
    """What a command says that a signal has ended, with its exit code: 128 and the number of the signal."""
    number = int(getattr(error, "number", signal.SIGINT))
    how = "interrupted" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}"
    return Interrupted(f"{how}{more}.", _KILLED + number)


@takes(sweep_options())
def sweep_command(
    scenarios: Annotated[
        list[str],
        typer.Argument(
            help="Names, scenario files, or one sweep file.",
            autocompletion=completion("scenario"),
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            parser=path_given, metavar="<path>", help="Folder of the rows; one that was interrupted is continued."
        ),
    ],
    *,
    trials: Annotated[
        int | None, typer.Option(help="Trials of each combination, all with the same seeds; default: 100.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="First seed; default: 0.")] = None,
    secret_seed_file: Annotated[
        Path | None,
        typer.Option(
            parser=path_given,
            metavar="<path>",
            help="Draw trials that nobody can draw without this file; made if it is not there.",
        ),
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Processes; default: the cores there are.")] = None,
    trial_limit: Annotated[
        float, typer.Option(metavar="SECONDS", help="A trial that takes longer has failed.")
    ] = 600.0,
    backend: Annotated[str, typer.Option(help="local, or ray for a cluster.")] = "local",
    address: Annotated[str | None, typer.Option(help="Of the Ray cluster, host:port.")] = None,
    **options: Any,
) -> None:
    """Run every combination, or the grids of a file, and print success rates with Wilson 95 % intervals."""
    from apo_bench.benchmark.analysis import tally
    from apo_bench.benchmark.sweeps.sweep import run_sweep
    from apo_bench.cli.terminal import print_cells, print_prediction

    options |= {"trials": trials, "seed": seed}
    grids = _grids(scenarios, {name: value for name, value in options.items() if value is not None})
    used = cores() if workers is None and backend == "local" else workers
    command = shlex.join(["apo-bench", *sys.argv[1:]])
    try:
        rows = run_sweep(
            grids,
            out,
            workers=used,
            limit_s=trial_limit,
            backend=backend,
            address=address,
            command=command,
            secret_seed_file=secret_seed_file,
        )
    except KeyboardInterrupt as error:
        raise interrupted(error, "; what had ended is kept, and the same command continues") from error
    print_cells(tally(rows))
    print_prediction(rows)
    typer.echo(
        f"{len(rows)} rows in {out / 'trials.jsonl'}; table and figure: apo-bench report {shlex.quote(str(out))}"
    )


def _grids(scenarios: list[str], options: Mapping[str, Any]) -> tuple[SweepConfig, ...]:
    """The grid of the options, or those of a sweep file with some settings replaced."""
    from apo_bench.benchmark.sweeps.grid import AXES, SweepConfig
    from apo_bench.benchmark.sweeps.sweep_file import is_sweep_file, read_sweep

    axes = {info.keyword: info for info in (*AXES, SETTINGS["noise_mm"], SETTINGS["noise_deg"])}
    texts = {axes[option]: text for option, text in options.items() if option in axes}
    others = {name: value for name, value in options.items() if name not in axes}
    files = [name for name in scenarios if is_sweep_file(name)]
    if not files:
        several: dict[str, Any] = {info.name: read_axis(info, text) for info, text in texts.items()}
        return (SweepConfig(tuple(scenarios), **several, **in_python(others)),)
    if len(scenarios) > 1:
        raise InputError(
            f"the sweep file {files[0]} was given together with {len(scenarios) - 1} more; name scenarios in the file, "
            "and run one file at a time."
        )
    for info in texts:
        raise InputError(
            f"--{info.option} was given together with the sweep file {files[0]}; write {info.name} into the file."
        )
    return read_sweep(files[0], others)


dataset = group(
    "dataset",
    "Data to learn from: whole trials as tables.",
    lambda: typer.echo("apo-bench dataset make SCENARIO --episodes 100 --out DIR"),
)


@dataset.command("make")
@takes(trial_options("noise_level", "human_error_scale", "noise", "method", "clearance_mm", "robot_error", "arm"))
def dataset_make(
    scenario: ScenarioArgument,
    more: Annotated[list[str] | None, typer.Argument(help="More scenarios.")] = None,
    *,
    out: Annotated[Path, typer.Option(parser=path_given, metavar="<path>", help="A folder that is not there yet.")],
    episodes: Annotated[int, typer.Option(help="Trials of each scenario.")] = 10,
    seed: Annotated[int, typer.Option(help="First seed; smaller ones are for evaluation.")] = FIRST_TRAINING_TRIAL,
    format: Annotated[str, typer.Option(help="parquet, lerobot or minari.")] = "parquet",
    record: Annotated[str, typer.Option(help="replays, or insertions: APOInsert-v0 led by a policy.")] = "replays",
    policy: Annotated[
        str | None, typer.Option(help="Of insertions: expert (default), straight, dagger-insert, or your own.")
    ] = None,
    **options: Any,
) -> None:
    """Run trials and write what was seen, planned and true, and all frames, with a card for people and programs."""
    from apo_bench.benchmark.datasets.making import make_dataset
    from apo_bench.trial.request import Request, requested_settings

    require(record in ("replays", "insertions"), f"--record {record} was given; replays or insertions is allowed.")
    require(
        seed >= FIRST_TRAINING_TRIAL,
        f"--seed {seed} was given; data to learn from begin at {FIRST_TRAINING_TRIAL}, since smaller numbers are "
        "trials for evaluation.",
    )
    require(episodes >= 1, f"--episodes {episodes} was given; a whole number from 1 is allowed.")
    require(
        policy is None or record == "insertions",
        f"--policy {policy} was given, but replays have none; say --record insertions as well.",
    )
    options["seed"] = seed
    names = (scenario, *(more or ()))
    for name in names:
        require(names.count(name) == 1, f"the scenario {name} was given twice; give each once.")
    asked = [Request(scenario=name, options=options) for name in names]
    several = [requested_settings(each, load_scenario(each.scenario).clearance_mm) for each in asked]
    trials = [replace(each, seed=each.seed + k) for each in several for k in range(episodes)]
    led = (policy or "expert") if record == "insertions" else None
    command = shlex.join(["apo-bench", *sys.argv[1:]])
    try:
        with writing():
            made, right = make_dataset(trials, out, command, format, led, partial(typer.echo, err=True))
    except KeyboardInterrupt as error:
        raise interrupted(error) from error
    typer.echo(f"{made} trials, {right} right; the card is {out / 'README.md'}")
