"""The command `apo-bench view`: look at a scenario or at a trial of a sweep, and step through it."""

from pathlib import Path
from typing import Annotated

import typer

from apo_bench.cli.arguments import path_given
from apo_bench.errors import InputError

Port = Annotated[
    int | None,
    typer.Option(help="Show it in a browser, at this port of 127.0.0.1; default: a window, or 8080 without a display."),
]


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(view)


def view(
    target: Annotated[
        str, typer.Argument(metavar="TARGET", help="A scenario, by its name or file, or the folder of a sweep.")
    ],
    trial: Annotated[
        int | None,
        typer.Option(help="Of a folder: the line of trials.jsonl; default: the first failure."),
    ] = None,
    port: Port = None,
    salt_file: Annotated[
        Path | None,
        typer.Option(parser=path_given, metavar="<path>", help="Of a salted sweep, to run it again."),
    ] = None,
) -> None:
    """Look at a scenario, or at a finished trial, which is run again, and step through it; `show` draws files."""
    from apo_bench.cli.terminal import print_row
    from apo_bench.scenario.file import load_scenario
    from apo_bench.show.trial_again import trial_again
    from apo_bench.show.viewing import choose_place
    from apo_bench.show.viewing import view as look_at
    from apo_bench.simulation.scene.scene import build_scene
    from apo_bench.trial.story import asked_for

    folder = Path(target)
    if not folder.is_dir():
        for value, option in ((trial, "--trial"), (salt_file, "--salt-file")):
            if value is not None:
                raise InputError(f"{option}, which is for the folder of a sweep, was given for {target}; leave it out.")
        scenario = load_scenario(target)
        place = choose_place(port)
        story = asked_for(build_scene(scenario))
    else:
        place = choose_place(port)
        row, story = trial_again(folder, trial, salt_file)
        print_row(row)
    look_at(story, place, port, typer.echo)
