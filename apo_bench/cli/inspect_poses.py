"""The command `apo-bench inspect poses`: a picture of observed and corrected poses."""

from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.assembly import Observation
from apo_bench.cli.shared import (
    DeviationDeg,
    DeviationMm,
    ScenarioArgument,
    add_options,
    check_output,
    make_path_option,
    make_trial_options,
    print_written,
)
from apo_bench.errors import require
from apo_bench.records import CORRECTOR, resolve_simulated


@add_options(make_trial_options("noise_level", "human_error_scale", "seed", "noise", "pose_source"))
def poses_command(
    scenario: ScenarioArgument,
    *,
    out: Annotated[Path, make_path_option("Draw the poses into this file: .png.")] = Path("poses.png"),
    observed: Annotated[bool, typer.Option("--observed", help="Draw the observed poses alone.")] = False,
    operation: Annotated[
        int | None, typer.Option(help="Show the state after this operation; default: the last.")
    ] = None,
    method: Annotated[str, typer.Option(help="Corrector by name, or package.module:name.")] = CORRECTOR,
    observation: Annotated[Path | None, make_path_option("Use this observation in place of a trial.")] = None,
    deviation_mm: DeviationMm = None,
    deviation_deg: DeviationDeg = None,
    **options: Any,
) -> None:
    """Draw the parts where they were observed, and where corrected poses put them.

    Examples:
      apo-bench inspect poses stick_in_tower --noise-level 2 --seed 7 --out poses.png
      apo-bench inspect poses stick_in_tower --observation docs/seen.csv --operation 2 --observed
    """
    from apo_bench import correct, fit_plan, load_scenario
    from apo_bench.formats.deviations import note_assumed_deviations
    from apo_bench.trial.plan_warnings import describe_plan_warnings
    from apo_bench.trial.request import load_or_draw_observation
    from apo_bench.viz.poses_picture import draw_poses, format_poses, make_poses_panel

    check_output(out, "--out", ".png")
    task = load_scenario(scenario)
    last = len(task.assembly)
    step = last if operation is None else operation
    require(1 <= step <= last, f"--operation must be from 1 to {last}, got {step}.")
    seen, assumed = load_or_draw_observation(scenario, observation, options, deviation_mm, deviation_deg)
    _check_observed(seen, step)
    panels = [make_poses_panel("observed", seen, seen.poses, step)]
    if not observed:
        correction = correct(seen, resolve_simulated(method))
        if not correction.ok:
            raise RuntimeError(f"{method} found no correction: {correction.sentence}; --observed needs none")
        plan = fit_plan(correction, seen, task)
        notes = "; ".join(filter(None, (plan.sentence, describe_plan_warnings(task, plan.plan, correction))))
        panels.append(make_poses_panel(f"corrected by {method}", seen, plan.plan.target_poses, step, notes))
    draw_poses(task, step, panels, out)
    typer.echo("\n".join(format_poses(panels)))
    if assumed and not observed:
        typer.echo(note_assumed_deviations(deviation_mm, deviation_deg))
    print_written(out)


def _check_observed(seen: Observation, step: int) -> None:
    """Raise where an operation up to this one was not observed: the poses after it are unknown."""
    missed = int(seen.observed.argmin()) + 1
    if seen.observed.all() or missed > step:
        return
    advice = f"; --observed --operation {missed - 1} draws the state before it" * (missed > 1)
    raise RuntimeError(f"operation {missed} was not observed, so the poses after it are unknown{advice}.")
