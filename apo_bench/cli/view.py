"""The command `apo-bench view`: a scenario or a finished trial, stepped through."""

from pathlib import Path
from typing import Annotated

import typer

from apo_bench.cli.arguments import Port
from apo_bench.cli.values import path_given
from apo_bench.errors import require
from apo_bench.scenario.file import load_scenario


def view_command(
    target: Annotated[
        str, typer.Argument(metavar="TARGET", help="A scenario, by its name or file, or the folder of a sweep.")
    ],
    trial: Annotated[
        int | None,
        typer.Option(help="Of a folder: the line of trials.jsonl; default: the first failure."),
    ] = None,
    port: Port = None,
    secret_seed_file: Annotated[
        Path | None,
        typer.Option(parser=path_given, metavar="<path>", help="Of a salted sweep, to run it again."),
    ] = None,
) -> None:
    """Look at a scenario, or at a finished trial, which is run again, and step through it; `show` draws files."""
    from apo_bench.cli.trial_text import print_row
    from apo_bench.simulation.scene.scene import build_scene
    from apo_bench.trial.rollout import scenario_story
    from apo_bench.viz.finished_trial import trial_again
    from apo_bench.viz.viewing import choose_display, view

    folder = Path(target)
    if folder.is_dir():
        place = choose_display(port)
        row, rollout = trial_again(folder, trial, secret_seed_file)
        print_row(row)
    else:
        for value, option in ((trial, "--trial"), (secret_seed_file, "--secret-seed-file")):
            require(
                value is None, f"{option}, which is for the folder of a sweep, was given for {target}; leave it out."
            )
        scenario = load_scenario(target)
        place = choose_display(port)
        rollout = scenario_story(build_scene(scenario))
    view(rollout, place, port, typer.echo)
