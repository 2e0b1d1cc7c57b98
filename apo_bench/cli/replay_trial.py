"""One command: `apo-bench replay`, a trial with all that can be told of it."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from apo_bench.cli.arguments import NO_RESULT, check_outputs
from apo_bench.cli.printing import print_json
from apo_bench.cli.setting_options import CacheFolder, CorrectorLimit, ScenarioArgument, takes, trial_options
from apo_bench.cli.show import Port
from apo_bench.cli.sweep import interrupted
from apo_bench.errors import InputError, require
from apo_bench.io.processes import redirect_output
from apo_bench.records import CORRECTOR_LIMIT_S

if TYPE_CHECKING:
    from apo_bench.trial.story import Story


@takes(trial_options())
def run_replay(
    scenario: ScenarioArgument,
    *,
    observation: Annotated[Path | None, typer.Option(help="Replay this observation file instead.")] = None,
    save_observation: Annotated[Path | None, typer.Option(help="Write what was seen to this JSON file.")] = None,
    video: Annotated[Path | None, typer.Option(help="Write a film of the replay: .mp4 or .gif.")] = None,
    trial_limit: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="End a trial that takes longer; it runs in a process of its own."),
    ] = None,
    corrector_limit: CorrectorLimit = CORRECTOR_LIMIT_S,
    cache: CacheFolder = None,
    view: Annotated[bool, typer.Option("--view", help="Then look at it and step through it, as `view` does.")] = False,
    port: Port = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the row, one JSON object, and nothing else.")] = False,
    **options: Any,
) -> None:
    """Run one trial: demonstrate, observe, plan by a method, replay, judge."""
    from apo_bench.cli.terminal import print_row
    from apo_bench.trial.request import Request, run_request

    check_outputs([(video, "--video", (".mp4", ".gif")), (save_observation, "--save-observation", (".json",))])
    if view:
        from apo_bench.show.viewing import choose_display

        place = choose_display(port)
    elif port is not None:
        raise InputError(f"--port {port}, which is for --view, was given without it; leave it out.")
    require(not view or trial_limit is None, "--view was given together with --trial-limit; leave one of them out.")
    request = Request(
        scenario=scenario,
        options=options,
        observation=observation,
        save_observation=save_observation,
        video=video,
        corrector_limit_s=corrector_limit,
        cache=cache,
    )
    stories: list[Story] = []
    try:
        with redirect_output(as_json):
            if trial_limit is None:
                row = run_request(request, stories.append if view else None)
            else:
                from apo_bench.sweeps.local.pool import run_request_alone

                row = run_request_alone(request, trial_limit)
    except KeyboardInterrupt as error:
        raise interrupted(error) from error
    if as_json:
        print_json(row)
    else:
        print_row(row)
    if video is not None and row["sim_seconds"] is None:
        typer.echo(f"apo-bench: nothing was replayed, so {video} was not written.", err=True)
    elif video is not None:
        typer.echo(f"Wrote {video}", err=as_json)
    if view and not stories:
        typer.echo("apo-bench: nothing was replayed, so there is nothing to view.", err=True)
    elif view:
        from apo_bench.show import viewing

        viewing.view(stories[0], place, port, partial(typer.echo, err=as_json))
    if row["success"] is None:
        raise typer.Exit(NO_RESULT)
