"""The command `apo-bench dataset make`: trials as data sets to learn from."""

import shlex
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.shared import (
    Command,
    ScenarioArgument,
    add_options,
    make_group,
    make_path_option,
    make_trial_options,
    name_write_errors,
)
from apo_bench.errors import require
from apo_bench.io import format_count
from apo_bench.records import FIRST_TRAINING_TRIAL

_HELP = """
Data sets to learn from.

Examples:
  apo-bench dataset make stick_in_tower --episodes 100 --out data
  apo-bench dataset make dovetail --format lerobot --record insertions --out inserted
"""
commands = make_group("dataset", _HELP)


@commands.command("make", cls=Command)
@add_options(
    make_trial_options("noise_level", "human_error_scale", "noise", "method", "clearance_mm", "robot_error", "arm")
)
def dataset_make(
    scenario: ScenarioArgument,
    more: Annotated[list[str] | None, typer.Argument(metavar="SCENARIO", help="More scenarios.")] = None,
    *,
    out: Annotated[Path, make_path_option("Folder of the data set; it must not exist.")],
    episodes: Annotated[int, typer.Option(min=1, help="Trials of each scenario.")] = 10,
    seed: Annotated[int, typer.Option(help="First seed; smaller ones are for evaluation.")] = FIRST_TRAINING_TRIAL,
    format: Annotated[str, typer.Option(help="parquet, lerobot or minari.")] = "parquet",
    record: Annotated[str, typer.Option(help="replays, or insertions (APOInsert-v0 with a policy).")] = "replays",
    policy: Annotated[
        str | None,
        typer.Option(help="Policy of insertions: expert (default), straight, spiral, searcher, probe, or module:name."),
    ] = None,
    **options: Any,
) -> None:
    """Run trials and write observations, plans, true poses and frames as a data set.

    Examples:
      apo-bench dataset make stick_in_tower --episodes 100 --noise-level 2 --out data
      apo-bench dataset make dovetail --format lerobot --record insertions --policy expert --out inserted
    """
    from apo_bench import load_scenario
    from apo_bench.benchmark.datasets.trial_dataset import make_dataset
    from apo_bench.trial.request import Request, requested_settings

    require(record in ("replays", "insertions"), f"--record must be replays or insertions, got {record}.")
    require(
        seed >= FIRST_TRAINING_TRIAL,
        f"--seed must be at least {FIRST_TRAINING_TRIAL}, since smaller seeds are for evaluation, got {seed}.",
    )
    insertions = record == "insertions"
    require(policy is None or insertions, f"--policy {policy} belongs to insertions; add --record insertions.")
    names = (scenario, *(more or ()))
    require(len({*names}) == len(names), "each scenario may be named once; remove the second one.")
    trials = []
    for name in names:
        request = Request(name, options | {"seed": seed})
        config = requested_settings(request, load_scenario(name).clearance_mm)
        trials += [replace(config, seed=seed + k) for k in range(episodes)]
    led_by = (policy or "expert") if insertions else None
    command = shlex.join(["apo-bench", *sys.argv[1:]])
    with name_write_errors():
        made, right = make_dataset(trials, out, command, format, led_by, partial(typer.echo, err=True))
    typer.echo(f"{format_count(made, 'trial')}, {right} successful; {out / 'README.md'} describes them")
