"""The command `apo-bench dataset make`: whole trials as tables to learn from."""

import shlex
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.arguments import path_given, writing
from apo_bench.cli.help_groups import Grouped
from apo_bench.cli.setting_options import ScenarioArgument, takes, trial_options
from apo_bench.errors import require
from apo_bench.scenario.file import load_scenario

dataset = typer.Typer(
    name="dataset", cls=Grouped, rich_markup_mode=None, help="Data to learn from: whole trials as tables."
)
_FIRST_SEED = 1_000_000
"""Seeds below are for what is reported."""


@dataset.callback(invoke_without_command=True)
def _without_command(context: typer.Context) -> None:
    """Say what can be made."""
    if context.invoked_subcommand is None:
        typer.echo("apo-bench dataset make SCENARIO --episodes 100 --out DIR")


@dataset.command("make")
@takes(trial_options("level", "careless", "noise", "method", "clearance_mm", "robot_error", "arm"))
def dataset_make(
    scenario: ScenarioArgument,
    more: Annotated[list[str] | None, typer.Argument(help="More scenarios.")] = None,
    *,
    out: Annotated[Path, typer.Option(parser=path_given, metavar="<path>", help="A folder that is not there yet.")],
    episodes: Annotated[int, typer.Option(help="Trials of each scenario.")] = 10,
    seed: Annotated[int, typer.Option(help="First seed; those of tracks and of the headline are small.")] = _FIRST_SEED,
    format: Annotated[str, typer.Option(help="parquet, lerobot or minari.")] = "parquet",
    record: Annotated[str, typer.Option(help="replays, or insertions: APOInsert-v0 led by a policy.")] = "replays",
    policy: Annotated[str, typer.Option(help="Of insertions: expert, straight or module:function.")] = "expert",
    **options: Any,
) -> None:
    """Run trials and write what was seen, planned and true, and all frames, with a card for people and programs."""
    from apo_bench.datasets.making import make_dataset
    from apo_bench.trial.request import Request, requested_settings

    require(record in ("replays", "insertions"), f"--record {record} was given; replays or insertions is allowed.")
    require(episodes >= 1, f"--episodes {episodes} was given; a whole number from 1 is allowed.")
    options["seed"] = seed
    asked = [Request(scenario=name, options=options) for name in (scenario, *(more or ()))]
    several = [requested_settings(each, load_scenario(each.scenario).clearance_mm) for each in asked]
    trials = [replace(each, seed=each.seed + k) for each in several for k in range(episodes)]
    led = policy if record == "insertions" else None
    with writing():
        made, right = make_dataset(
            trials, out, shlex.join(["apo-bench", *sys.argv[1:]]), format, led, partial(typer.echo, err=True)
        )
    typer.echo(f"{made} trials, {right} right; the card is {out / 'README.md'}")
