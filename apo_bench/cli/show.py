"""Two commands to look at things: `apo-bench show | view`, a picture of what is believed, a window to step through.

One command: `apo-bench replay`, a trial with all that can be told of it.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from apo_bench.assembly import Observation
from apo_bench.cli.printing import print_json
from apo_bench.cli.setting_options import (
    NO_RESULT,
    CacheFolder,
    CorrectorLimit,
    ScenarioArgument,
    StatedDeg,
    StatedMm,
    check_outputs,
    check_writable,
    path_given,
    takes,
    trial_options,
)
from apo_bench.cli.sweep import interrupted
from apo_bench.errors import InputError, require
from apo_bench.files.deviations import assumed_deviations
from apo_bench.io import redirect_output
from apo_bench.records import CORRECTOR, CORRECTOR_LIMIT_S, with_simulated
from apo_bench.scenario.file import load_scenario
from apo_bench.scenario.scenario import Scenario

if TYPE_CHECKING:
    from apo_bench.show.believed_picture import BeliefPanel

Port = Annotated[
    int | None,
    typer.Option(help="Show it in a browser, at this port of 127.0.0.1; default: a window, or 8080 without a display."),
]


@takes(trial_options("level", "careless", "seed", "noise", "eye"))
def show_command(
    scenario: ScenarioArgument,
    *,
    out: Annotated[Path, typer.Option(help="Draw it into this file: .png.")] = Path("believed.png"),
    seen: Annotated[bool, typer.Option("--seen", help="Only what was seen.")] = False,
    corrected: Annotated[bool, typer.Option("--corrected", help="Only what the method makes of it.")] = False,
    step: Annotated[int | None, typer.Option(help="After this operation, from 1; default: the last.")] = None,
    method: Annotated[str, typer.Option(help="A corrector, or package.module:name.")] = CORRECTOR,
    observation: Annotated[Path | None, typer.Option(help="Show this observation file instead.")] = None,
    deviation_mm: StatedMm = None,
    deviation_deg: StatedDeg = None,
    **options: Any,
) -> None:
    """Draw the believed state: parts where they were seen, and where the corrected motion parameters put them."""
    from apo_bench.show.believed_picture import belief_lines, belief_panel, draw_beliefs
    from apo_bench.trial.request import looked_at

    check_writable(out, "--out", (".png",))
    loaded = load_scenario(scenario)
    k = _step(len(loaded.assembly), step)
    observed, assumed = looked_at(scenario, observation, options, deviation_mm, deviation_deg)
    _check_seen(observed, k)
    panels = [] if corrected and not seen else [belief_panel("as seen", observed, observed.goals, k)]
    if corrected or not seen:
        panels.append(_corrected(loaded, observed, method, k))
    draw_beliefs(loaded, k, panels, out)
    lines = belief_lines(panels)
    if assumed and (corrected or not seen):
        lines.append(assumed_deviations(deviation_mm, deviation_deg))
    typer.echo("\n".join([*lines, f"Wrote {out}"]))


def view_command(
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
    from apo_bench.show.viewing import choose_display, trial_again, view
    from apo_bench.simulation.scene.scene import build_scene
    from apo_bench.trial.story import scenario_story

    folder = Path(target)
    if not folder.is_dir():
        for value, option in ((trial, "--trial"), (salt_file, "--salt-file")):
            require(
                value is None, f"{option}, which is for the folder of a sweep, was given for {target}; leave it out."
            )
        scenario = load_scenario(target)
        place = choose_display(port)
        story = scenario_story(build_scene(scenario))
    else:
        place = choose_display(port)
        row, story = trial_again(folder, trial, salt_file)
        print_row(row)
    view(story, place, port, typer.echo)


def _corrected(scenario: Scenario, observed: Observation, method: str, step: int) -> BeliefPanel:
    from apo_bench.correction.own_code.own import correct_named
    from apo_bench.show.believed_picture import belief_panel
    from apo_bench.trial.fitting import fitting_plan
    from apo_bench.trial.planning import plan_warning

    correction = correct_named(observed, with_simulated(method))
    if not correction.ok:
        raise RuntimeError(
            f"{method} did not correct what was seen: {correction.sentence.rstrip('.')}; --seen draws what was seen."
        )
    planned = fitting_plan(correction, observed, scenario)
    notes = "; ".join(filter(None, (planned.sentence, plan_warning(scenario, planned.plan, correction))))
    return belief_panel(f"corrected by {method}", observed, planned.plan.goals, step, notes)


def _check_seen(observed: Observation, step: int) -> None:
    """Nothing is known after an operation that was not seen."""
    missed = int(observed.seen.argmin()) + 1
    if observed.seen.all() or missed > step:
        return
    before = f"--seen --step {missed - 1} shows what is known before it" if missed > 1 else "nothing is known before it"
    raise RuntimeError(f"operation {missed} was not seen, so nothing is known after it; {before}.")


def _step(operations: int, step: int | None) -> int:
    require(
        step is None or 1 <= step <= operations,
        f"step {step} was given; the scenario has operations 1 to {operations}.",
    )
    return operations if step is None else step


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
