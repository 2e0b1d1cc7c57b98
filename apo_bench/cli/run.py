"""The command `apo-bench run`: one trial, from the demonstration to the verdict."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.shared import (
    NO_RESULT,
    Port,
    ScenarioArgument,
    add_options,
    check_output,
    make_path_option,
    make_trial_options,
    print_columns,
    print_json,
)
from apo_bench.errors import require
from apo_bench.io import redirect_output


@add_options(make_trial_options())
def run_command(
    scenario: ScenarioArgument,
    *,
    observation: Annotated[
        Path | None, make_path_option("Replay this observation (.json or .csv) in place of a demonstration.")
    ] = None,
    save_observation: Annotated[
        Path | None, make_path_option("Write the observed poses into this file: .json.")
    ] = None,
    video: Annotated[Path | None, make_path_option("Write a film of the replay: .mp4 or .gif.")] = None,
    trial_limit: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="End a trial that takes longer; it runs in another process."),
    ] = None,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Print every number of the record.")] = False,
    view: Annotated[bool, typer.Option("--view", help="Step through the trial after its end, as `view` does.")] = False,
    port: Port = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the record as one JSON object, nothing else.")] = False,
    **options: Any,
) -> None:
    """Run one trial: demonstrate, observe, correct, replay, judge.

    Examples:
      apo-bench run stick_in_tower --noise-level 1 --seed 7
      apo-bench run stick_in_tower --observation docs/seen.csv --method contact -v
    """
    from apo_bench.trial.request import Request, run_request
    from apo_bench.trial.rollout import Rollout
    from apo_bench.viz.choose_viewer import choose_display
    from apo_bench.viz.choose_viewer import view as step_through
    from apo_bench.viz.form_text import list_facts
    from apo_bench.viz.trial_text import format_summary

    check_output(video, "--video", ".mp4", ".gif")
    check_output(save_observation, "--save-observation", ".json")
    display = choose_display(port) if view else None
    require(view or port is None, f"--port {port} belongs to --view; add --view, or leave the port out.")
    require(not view or trial_limit is None, "--view and --trial-limit exclude each other; leave one of them out.")
    request = Request(scenario, options, observation, save_observation, video)
    rollouts = list[Rollout]()
    with redirect_output(as_json):
        if trial_limit is None:
            record = run_request(request, rollouts.append if view else None)
        else:
            from apo_bench.benchmark.sweeps.pool import run_request_alone

            record = run_request_alone(request, trial_limit)
    if as_json:
        print_json(record)
    else:
        more = list_facts(record) if verbose else []
        print_columns([*format_summary(record, scenario, observation), *more])
    replayed = record["sim_time_s"] is not None
    if not replayed and (video or view):
        typer.echo("apo-bench: the robot did not replay anything, so there is nothing to see.", err=True)
    if replayed and video:
        typer.echo(f"Wrote {video}", err=as_json)
    if replayed and display is not None:
        step_through(rollouts[0], display, port, partial(typer.echo, err=as_json))
    if record["success"] is None:
        raise typer.Exit(NO_RESULT)
