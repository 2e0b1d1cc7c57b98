"""The command `apo-bench run`: one trial with all that can be told of it."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.arguments import NO_RESULT, Port, ScenarioArgument
from apo_bench.cli.outputs import check_outputs
from apo_bench.cli.printing import print_json
from apo_bench.cli.setting_options import takes, trial_options
from apo_bench.cli.sweep import interrupted
from apo_bench.errors import require
from apo_bench.io import redirect_output


@takes(trial_options())
def run_command(
    scenario: ScenarioArgument,
    *,
    observation: Annotated[Path | None, typer.Option(help="Replay this observation file instead.")] = None,
    save_observation: Annotated[Path | None, typer.Option(help="Write what was seen to this JSON file.")] = None,
    video: Annotated[Path | None, typer.Option(help="Write a film of the replay: .mp4 or .gif.")] = None,
    trial_limit: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="End a trial that takes longer; it runs in a process of its own."),
    ] = None,
    view: Annotated[bool, typer.Option("--view", help="Then look at it and step through it, as `view` does.")] = False,
    port: Port = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the row, one JSON object, and nothing else.")] = False,
    **options: Any,
) -> None:
    """Run one trial: demonstrate, observe, plan by a method, replay, judge."""
    from apo_bench.cli.trial_text import print_row
    from apo_bench.trial.request import Request, run_request
    from apo_bench.trial.rollout import Rollout
    from apo_bench.viz.viewing import choose_display
    from apo_bench.viz.viewing import view as show_story

    check_outputs([(video, "--video", (".mp4", ".gif")), (save_observation, "--save-observation", (".json",))])
    place = choose_display(port) if view else None
    require(view or port is None, f"--port {port}, which is for --view, was given without it; leave it out.")
    require(not view or trial_limit is None, "--view was given together with --trial-limit; leave one of them out.")
    request = Request(
        scenario=scenario,
        options=options,
        observation=observation,
        save_observation=save_observation,
        video=video,
    )
    rollouts = list[Rollout]()
    try:
        with redirect_output(as_json):
            if trial_limit is None:
                row = run_request(request, rollouts.append if view else None)
            else:
                from apo_bench.benchmark.sweeps.pool import run_request_alone

                row = run_request_alone(request, trial_limit)
    except KeyboardInterrupt as error:
        raise interrupted(error) from error
    if as_json:
        print_json(row)
    else:
        print_row(row)
    replayed = row["sim_time_s"] is not None
    if video is not None and replayed:
        typer.echo(f"Wrote {video}", err=as_json)
    elif video is not None:
        typer.echo(f"apo-bench: nothing was replayed, so {video} was not written.", err=True)
    if place is not None and replayed:
        show_story(rollouts[0], place, port, partial(typer.echo, err=as_json))
    elif place is not None:
        typer.echo("apo-bench: nothing was replayed, so there is nothing to view.", err=True)
    if row["success"] is None:
        raise typer.Exit(NO_RESULT)
