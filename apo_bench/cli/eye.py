"""One command: `apo-bench eye`, what the range finder makes of one demonstration."""

import json
from pathlib import Path
from typing import Annotated

import typer

from apo_bench.cli.arguments import NO_RESULT, check_writable
from apo_bench.cli.setting_options import ScenarioArgument


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(eye)


def eye(
    scenario: ScenarioArgument,
    level: Annotated[float, typer.Option(help="Standard deviation of one ray, mm.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Which demonstration.")] = 0,
    careless: Annotated[float, typer.Option(help="0 is a careful human, 1 the scenario's.")] = 1.0,
    view: Annotated[int, typer.Option(help="Which view of the range finder the picture shows, from 1.")] = 1,
    out: Annotated[Path | None, typer.Option(help="Draw every stage of seeing into this file: .png.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object, and nothing else.")] = False,
) -> None:
    """Watch a demonstration with a range finder: what moved, which part it was, where it went."""
    from apo_bench.show.sensor_run import checked_view, run_sensor, sensor_form, sensor_lines

    if out is not None:
        check_writable(out, "--out", (".png",))
    shows = checked_view(view)
    seen = run_sensor(scenario, level, seed, careless)
    form = sensor_form(seen, level, seed, careless)
    typer.echo(json.dumps(form, allow_nan=False) if as_json else "\n".join(sensor_lines(form)))
    if out is not None:
        from apo_bench.show.sensor_picture import draw_sensor

        draw_sensor(seen, out, shows)
        if not as_json:
            typer.echo(f"\nWrote {out}")
    if not all(operation["found"] for operation in form["operations"]):
        raise typer.Exit(NO_RESULT)
