"""The command `apo-bench detect-contacts`: contacts from poses."""

from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.arguments import AsJson, ScenarioArgument, StatedDeg, StatedMm
from apo_bench.cli.printing import console, print_json
from apo_bench.cli.setting_options import takes, trial_options
from apo_bench.errors import require_known
from apo_bench.formats.deviations import assumed_deviations
from apo_bench.io import redirect_output
from apo_bench.records import DETECTED
from apo_bench.scenario.file import load_scenario


@takes(trial_options("noise_level", "human_error_scale", "seed", "noise", "pose_source"))
def detect_contacts_command(
    scenario: ScenarioArgument,
    *,
    observation: Annotated[Path | None, typer.Option(help="What was seen, .csv or .json, instead of a trial.")] = None,
    deviation_mm: StatedMm = None,
    deviation_deg: StatedDeg = None,
    contact_source: Annotated[
        str,
        typer.Option(help="recognised or recognised-jointly."),
    ] = "detected",
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """Find the contacts of what was seen, and say how they differ from those of the scenario."""
    from apo_bench.trial.detected_contacts import detect_by
    from apo_bench.trial.request import load_or_draw_observation
    from apo_bench.viz.recognised_text import confidence_lines, difference_lines, evidence_table, recognition_form

    require_known("way of recognising", contact_source, DETECTED)
    name = load_scenario(scenario).name
    with redirect_output(as_json):
        seen, assumed = load_or_draw_observation(scenario, observation, options, deviation_mm, deviation_deg)
    form = recognition_form(name, contact_source, seen, detect_by(seen, contact_source), assumed)
    if as_json:
        print_json(form)
        return
    console(140).print(evidence_table(form))
    if assumed:
        typer.echo("\n" + assumed_deviations(deviation_mm, deviation_deg))
    typer.echo("\n" + "\n".join([*confidence_lines(form), *difference_lines(form)]))
    if not seen.observed.all():
        missing = ", ".join(str(k + 1) for k, was_seen in enumerate(seen.observed) if not was_seen)
        typer.echo(f"not seen, so nothing is recognised there: operation {missing}")
