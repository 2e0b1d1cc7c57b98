"""The command `apo-bench show`: a picture of what is believed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from apo_bench.assembly.goals import Observation
from apo_bench.cli.arguments import check_writable
from apo_bench.cli.setting_options import ScenarioArgument, takes, trial_options
from apo_bench.errors import InputError
from apo_bench.files.deviations import assumed_deviations
from apo_bench.records.short_names import CORRECTOR
from apo_bench.scenario.scenario import Scenario

if TYPE_CHECKING:
    from apo_bench.show.believed_picture import BeliefPanel


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(show)


@takes(trial_options("level", "careless", "seed", "noise", "eye"))
def show(
    scenario: ScenarioArgument,
    *,
    out: Annotated[Path, typer.Option(help="Draw it into this file: .png.")] = Path("believed.png"),
    seen: Annotated[bool, typer.Option("--seen", help="Only what was seen.")] = False,
    corrected: Annotated[bool, typer.Option("--corrected", help="Only what the method makes of it.")] = False,
    step: Annotated[int | None, typer.Option(help="After this operation, from 1; default: the last.")] = None,
    method: Annotated[str, typer.Option(help="A corrector, or package.module:name.")] = CORRECTOR,
    observation: Annotated[Path | None, typer.Option(help="Show this observation file instead.")] = None,
    deviation_mm: Annotated[float | None, typer.Option(help="Its standard deviation where it states none, mm.")] = None,
    deviation_deg: Annotated[float | None, typer.Option(help="The same in degrees.")] = None,
    **asked: Any,
) -> None:
    """Draw the believed state: parts where they were seen, and where the corrected motion parameters put them."""
    from apo_bench.scenario.file import load_scenario
    from apo_bench.show.believed_picture import belief_lines, belief_panel, draw_beliefs
    from apo_bench.trial.request import looked_at

    check_writable(out, "--out", (".png",))
    loaded = load_scenario(scenario)
    k = _step(len(loaded.assembly), step)
    deviations = {"deviation_mm": deviation_mm, "deviation_deg": deviation_deg}
    looked, assumed = looked_at(scenario, observation, asked, deviations)
    _check_seen(looked, k)
    panels = [] if corrected and not seen else [belief_panel("as seen", looked, looked.goals, k)]
    if corrected or not seen:
        panels.append(_corrected(loaded, looked, method, k))
    draw_beliefs(loaded, k, panels, out)
    said = belief_lines(panels)
    if assumed and (corrected or not seen):
        said.append(assumed_deviations(deviation_mm, deviation_deg))
    typer.echo("\n".join([*said, f"Wrote {out}"]))


def _corrected(scenario: Scenario, looked: Observation, method: str, step: int) -> BeliefPanel:
    from apo_bench.correction.own_code.own import correct_named
    from apo_bench.show.believed_picture import belief_panel
    from apo_bench.trial.fitting import fitting_plan
    from apo_bench.trial.methods import with_simulated
    from apo_bench.trial.plan_warning import plan_warning

    correction = correct_named(looked, with_simulated(method))
    if not correction.ok:
        raise RuntimeError(
            f"{method} did not correct what was seen: {correction.sentence.rstrip('.')}; --seen draws what was seen."
        )
    planned = fitting_plan(correction, looked, scenario)
    warning = plan_warning(scenario, planned.plan, correction)
    said = "; ".join(filter(None, (planned.sentence, warning)))
    return belief_panel(f"corrected by {method}", looked, planned.plan.goals, step, said)


def _check_seen(looked: Observation, step: int) -> None:
    """Nothing is known after an operation that was not seen."""
    missed = int(looked.seen.argmin()) + 1
    if looked.seen.all() or missed > step:
        return
    before = f"--seen --step {missed - 1} shows what is known before it" if missed > 1 else "nothing is known before it"
    raise RuntimeError(f"operation {missed} was not seen, so nothing is known after it; {before}.")


def _step(operations: int, step: int | None) -> int:
    if step is None:
        return operations
    if not 1 <= step <= operations:
        raise InputError(f"step {step} was given; the scenario has operations 1 to {operations}.")
    return step
