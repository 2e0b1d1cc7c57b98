"""The command `apo-bench recognise`: which face touches which, from what was seen."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.setting_options import ScenarioArgument, takes, trial_options
from apo_bench.errors import InputError, unknown
from apo_bench.files.deviations import assumed_deviations
from apo_bench.io.output import redirect_output


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(recognise)


@takes(trial_options("level", "careless", "seed", "noise", "eye"))
def recognise(
    scenario: ScenarioArgument,
    *,
    observation: Annotated[Path | None, typer.Option(help="What was seen, .csv or .json, instead of a trial.")] = None,
    deviation_mm: Annotated[float | None, typer.Option(help="Its standard deviation where it states none, mm.")] = None,
    deviation_deg: Annotated[float | None, typer.Option(help="The same in degrees.")] = None,
    relations: Annotated[
        str,
        typer.Option(help="recognised, recognised-fixed (6 mm and 10 deg), recognised-twice or recognised-jointly."),
    ] = "recognised",
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object, and nothing else.")] = False,
    **asked: Any,
) -> None:
    """Find the contacts of what was seen, and say how they differ from those of the scenario."""
    from apo_bench.records.relations import RECOGNISED
    from apo_bench.scenario.file import load_scenario
    from apo_bench.show.recognised_text import confidence_line, difference_lines, evidence_table, recognition_form
    from apo_bench.trial.recognised_contacts import recognise_by
    from apo_bench.trial.request import looked_at

    if relations not in RECOGNISED:
        raise InputError(unknown("way of recognising", relations, RECOGNISED))
    deviations = {"deviation_mm": deviation_mm, "deviation_deg": deviation_deg}
    name = load_scenario(scenario).name
    with redirect_output(as_json):
        seen, assumed = looked_at(scenario, observation, asked, deviations)
    found = recognise_by(seen, relations)
    if as_json:
        typer.echo(json.dumps(recognition_form(name, relations, seen, found, assumed), allow_nan=False))
        return
    _print(evidence_table(found, seen.assembly))
    if assumed:
        typer.echo("\n" + assumed_deviations(deviation_mm, deviation_deg))
    typer.echo("\n" + "\n".join([*confidence_line(found), *difference_lines(seen, found)]))
    if not seen.seen.all():
        missing = ", ".join(str(k + 1) for k, was in enumerate(seen.seen) if not was)
        typer.echo(f"not seen, so nothing is recognised there: operation {missing}")


def _print(table: Any) -> None:
    """Print a table as wide as it is."""
    from rich.console import Console

    console = Console(width=max(140, Console().width), highlight=False, markup=False)
    console.print(table)
