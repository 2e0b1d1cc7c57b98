"""The command `apo-bench detect-contacts`: contacts from observed poses."""

from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.shared import (
    AsJson,
    DeviationDeg,
    DeviationMm,
    ScenarioArgument,
    add_options,
    make_path_option,
    make_trial_options,
    print_columns,
    print_json,
    print_table,
)
from apo_bench.errors import require_known
from apo_bench.io import redirect_output
from apo_bench.records import DETECTED


@add_options(make_trial_options("noise_level", "human_error_scale", "seed", "noise", "pose_source"))
def detect_contacts_command(
    scenario: ScenarioArgument,
    *,
    observation: Annotated[Path | None, make_path_option("Use this observation in place of a trial.")] = None,
    deviation_mm: DeviationMm = None,
    deviation_deg: DeviationDeg = None,
    contact_source: Annotated[str, typer.Option(help="detected, or detected-jointly.")] = "detected",
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """Detect contacts in observed poses, and compare them with those of the scenario.

    Examples:
      apo-bench detect-contacts stick_in_tower --noise-level 2 --seed 3
      apo-bench detect-contacts stick_in_tower --observation docs/seen.csv --contact-source detected-jointly
    """
    from apo_bench.formats.deviations import note_assumed_deviations
    from apo_bench.trial.detected_contacts import detect_with_source
    from apo_bench.trial.request import load_or_draw_observation
    from apo_bench.viz.detection_text import CONTACT_COLUMNS, make_detection_form
    from apo_bench.viz.form_text import list_facts, make_table

    require_known("contact source", contact_source, DETECTED)
    with redirect_output(as_json):
        observed, assumed = load_or_draw_observation(scenario, observation, options, deviation_mm, deviation_deg)
    form = make_detection_form(
        scenario, contact_source, observed, detect_with_source(observed, contact_source), assumed
    )
    if as_json:
        print_json(form)
        return
    print_table(make_table(form["contacts"], CONTACT_COLUMNS), 140)
    typer.echo()
    print_columns(list_facts(form, ("schema", "contacts")))
    if assumed:
        typer.echo(note_assumed_deviations(deviation_mm, deviation_deg))
