"""The command `apo-bench inspect poses`: a picture of what is believed."""

from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.assembly import Observation
from apo_bench.cli.arguments import ScenarioArgument, StatedDeg, StatedMm
from apo_bench.cli.outputs import check_writable
from apo_bench.cli.setting_options import takes, trial_options
from apo_bench.errors import require
from apo_bench.formats.deviations import assumed_deviations
from apo_bench.geometry import Array
from apo_bench.records import CORRECTOR, with_simulated
from apo_bench.scenario.file import load_scenario
from apo_bench.scenario.scenario import Scenario


@takes(trial_options("noise_level", "human_error_scale", "seed", "noise", "pose_source"))
def poses_command(
    scenario: ScenarioArgument,
    *,
    out: Annotated[Path, typer.Option(help="Draw it into this file: .png.")] = Path("estimates.png"),
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
    from apo_bench.trial.request import load_or_draw_observation
    from apo_bench.viz.believed_picture import belief_lines, belief_panel, draw_beliefs

    check_writable(out, "--out", (".png",))
    loaded = load_scenario(scenario)
    last = len(loaded.assembly)
    k = last if step is None else step
    require(1 <= k <= last, f"step {step} was given; the scenario has operations 1 to {last}.")
    observed, assumed = load_or_draw_observation(scenario, observation, options, deviation_mm, deviation_deg)
    _check_seen(observed, k)
    panels = []
    if seen or not corrected:
        panels.append(belief_panel("as seen", observed, observed.poses, k))
    if corrected or not seen:
        goals, notes = _correct(loaded, observed, method)
        panels.append(belief_panel(f"corrected by {method}", observed, goals, k, notes))
    draw_beliefs(loaded, k, panels, out)
    lines = belief_lines(panels)
    if assumed and (corrected or not seen):
        lines.append(assumed_deviations(deviation_mm, deviation_deg))
    typer.echo("\n".join([*lines, f"Wrote {out}"]))


def _correct(scenario: Scenario, observed: Observation, method: str) -> tuple[Array, str]:
    """The goals that are planned, (n, 4, 4), and what speaks against them."""
    from apo_bench.correction.correctors import correct
    from apo_bench.trial.fitting import fitting_plan
    from apo_bench.trial.plan_warnings import plan_warning

    correction = correct(observed, with_simulated(method))
    if not correction.ok:
        raise RuntimeError(
            f"{method} did not correct what was seen: {correction.sentence.rstrip('.')}; --seen draws what was seen."
        )
    planned = fitting_plan(correction, observed, scenario)
    notes = filter(None, (planned.sentence, plan_warning(scenario, planned.plan, correction)))
    return planned.plan.target_poses, "; ".join(notes)


def _check_seen(observed: Observation, step: int) -> None:
    """Nothing is known after an operation that was not seen."""
    missed = int(observed.observed.argmin()) + 1
    if observed.observed.all() or missed > step:
        return
    before = f"--seen --step {missed - 1} shows what is known before it" if missed > 1 else "nothing is known before it"
    raise RuntimeError(f"operation {missed} was not seen, so nothing is known after it; {before}.")
