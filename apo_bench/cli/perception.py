"""Two commands on what a camera sees: `apo-bench eye | recognise`, poses from depth images, contacts from poses."""

from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.arguments import NO_RESULT, check_outputs
from apo_bench.cli.printing import console, print_json
from apo_bench.cli.setting_options import AsJson, ScenarioArgument, StatedDeg, StatedMm, takes, trial_options
from apo_bench.errors import require_known
from apo_bench.files.deviations import assumed_deviations
from apo_bench.io.processes import redirect_output
from apo_bench.records import RECOGNISED
from apo_bench.scenario.file import load_scenario


def eye_command(
    scenario: ScenarioArgument,
    level: Annotated[float, typer.Option(help="Standard deviation of one ray, mm.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Which demonstration.")] = 0,
    careless: Annotated[float, typer.Option(help="0 is a careful human, 1 the scenario's.")] = 1.0,
    view: Annotated[int, typer.Option(help="Which view of the range finder the picture shows, from 1.")] = 1,
    out: Annotated[Path | None, typer.Option(help="Draw every stage of seeing into this file: .png.")] = None,
    as_json: AsJson = False,
) -> None:
    """Watch a demonstration with a range finder: what moved, which part it was, where it went."""
    from apo_bench.show.sensor import checked_view, run_sensor, sensor_form, sensor_lines

    check_outputs([(out, "--out", (".png",))])
    drawn_view = checked_view(view)
    sensor_run = run_sensor(scenario, level, seed, careless)
    form = sensor_form(sensor_run, level, seed, careless)
    if as_json:
        print_json(form)
    else:
        typer.echo("\n".join(sensor_lines(form)))
    if out is not None:
        from apo_bench.show.sensor import draw_sensor

        draw_sensor(sensor_run, out, drawn_view)
        if not as_json:
            typer.echo(f"\nWrote {out}")
    if not all(operation["found"] for operation in form["operations"]):
        raise typer.Exit(NO_RESULT)


@takes(trial_options("level", "careless", "seed", "noise", "eye"))
def recognise_command(
    scenario: ScenarioArgument,
    *,
    observation: Annotated[Path | None, typer.Option(help="What was seen, .csv or .json, instead of a trial.")] = None,
    deviation_mm: StatedMm = None,
    deviation_deg: StatedDeg = None,
    relations: Annotated[
        str,
        typer.Option(help="recognised, recognised-fixed (6 mm and 10 deg), recognised-twice or recognised-jointly."),
    ] = "recognised",
    as_json: AsJson = False,
    **options: Any,
) -> None:
    """Find the contacts of what was seen, and say how they differ from those of the scenario."""
    from apo_bench.show.recognised_text import confidence_line, difference_lines, evidence_table, recognition_form
    from apo_bench.trial.recognised_contacts import recognise_by
    from apo_bench.trial.request import looked_at

    require_known("way of recognising", relations, RECOGNISED)
    name = load_scenario(scenario).name
    with redirect_output(as_json):
        seen, assumed = looked_at(scenario, observation, options, deviation_mm, deviation_deg)
    recognised = recognise_by(seen, relations)
    if as_json:
        print_json(recognition_form(name, relations, seen, recognised, assumed))
        return
    console(140).print(evidence_table(recognised, seen.assembly))
    if assumed:
        typer.echo("\n" + assumed_deviations(deviation_mm, deviation_deg))
    typer.echo("\n" + "\n".join([*confidence_line(recognised), *difference_lines(seen, recognised)]))
    if not seen.seen.all():
        missing = ", ".join(str(k + 1) for k, was_seen in enumerate(seen.seen) if not was_seen)
        typer.echo(f"not seen, so nothing is recognised there: operation {missing}")
