"""The command `apo-bench sweep`: many trials, from options or a file."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from apo_bench.cli.shared import (
    Address,
    Backend,
    Workers,
    add_options,
    complete_last_word,
    count_cores,
    make_path_option,
    make_sweep_options,
    read_axis,
)
from apo_bench.errors import require
from apo_bench.records import SETTINGS, convert_to_python_units

if TYPE_CHECKING:
    from apo_bench.benchmark.sweeps.grid import SweepConfig


@add_options(make_sweep_options())
def sweep_command(
    scenarios: Annotated[
        list[str],
        typer.Argument(
            metavar="SCENARIO",
            help="Scenarios by name or file, or one sweep file.",
            autocompletion=complete_last_word("scenario"),
        ),
    ],
    out: Annotated[Path, make_path_option("Folder of the records; an interrupted sweep continues there.")],
    *,
    trials: Annotated[
        int | None, typer.Option(help="Trials of each combination, by default all with the same seeds; default: 100.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="First seed; default: 0.")] = None,
    independent_seeds: Annotated[
        bool, typer.Option("--independent-seeds", help="Draw other seeds for each condition, the same for all methods.")
    ] = False,
    secret_seed_file: Annotated[
        Path | None,
        make_path_option(
            "Draw trials that nobody can draw without this file; the sweep writes it if it does not exist."
        ),
    ] = None,
    workers: Workers = None,
    trial_limit: Annotated[
        float, typer.Option(metavar="SECONDS", help="A trial that takes longer has failed.")
    ] = 600.0,
    backend: Backend = "local",
    address: Address = None,
    **options: Any,
) -> None:
    """Run every combination of settings, and print success rates with Wilson 95 % intervals.

    Examples:
      apo-bench sweep stick_in_tower --noise-level 0.5,1 --method uncorrected,contact --trials 10 --out runs/mine
      apo-bench sweep mine.toml --out runs/mine --trials 100
    """
    from apo_bench import run_sweep
    from apo_bench.benchmark.analysis import tabulate_confusion, tally
    from apo_bench.benchmark.report.tables.methods import summarise_predictions
    from apo_bench.cli.rates import print_rates

    options |= {"trials": trials, "seed": seed, "independent_seeds": independent_seeds or None}
    records = run_sweep(
        _read_grids(scenarios, {name: value for name, value in options.items() if value is not None}),
        out,
        workers=count_cores() if workers is None and backend == "local" else workers,
        limit_s=trial_limit,
        backend=backend,
        address=address,
        command=shlex.join(["apo-bench", *sys.argv[1:]]),
        secret_seed_file=secret_seed_file,
    )
    print_rates(tally(records))
    typer.echo(summarise_predictions(tabulate_confusion(records)[-1]))
    typer.echo(f"{len(records)} records in {out / 'trials.jsonl'}; report: apo-bench report {shlex.quote(str(out))}")


def _read_grids(scenarios: list[str], options: Mapping[str, Any]) -> tuple[SweepConfig, ...]:
    """The grid of the options, or those of a sweep file with some settings replaced."""
    from apo_bench.benchmark.sweeps.grid import AXES, SweepConfig
    from apo_bench.benchmark.sweeps.sweep_file import is_sweep_file, read_sweep

    axes = {info.keyword: info for info in (*AXES, SETTINGS["noise_mm"], SETTINGS["noise_deg"])}
    texts = {axes[option]: text for option, text in options.items() if option in axes}
    others = {name: value for name, value in options.items() if name not in axes}
    file = next(filter(is_sweep_file, scenarios), None)
    if file is None:
        values: dict[str, Any] = {info.name: read_axis(info, text) for info, text in texts.items()}
        return (SweepConfig(tuple(scenarios), **values, **convert_to_python_units(others)),)
    require(len(scenarios) == 1, f"the sweep file {file} excludes other scenarios; name them in the file.")
    given = ", ".join(f"--{info.option}" for info in texts)
    require(not given, f"{given} and the sweep file {file} exclude each other; write the setting into the file.")
    return read_sweep(file, others)
