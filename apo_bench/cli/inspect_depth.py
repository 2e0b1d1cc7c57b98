"""The command `apo-bench inspect depth`: poses from depth images of a demonstration."""

from pathlib import Path
from typing import Annotated

import typer

from apo_bench.cli.arguments import NO_RESULT, AsJson, ScenarioArgument
from apo_bench.cli.outputs import check_outputs
from apo_bench.cli.printing import console, print_json, say


def depth_command(
    scenario: ScenarioArgument,
    noise_level: Annotated[float, typer.Option(help="Standard deviation of one ray, mm.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Which demonstration.")] = 0,
    human_error_scale: Annotated[float, typer.Option(help="0 is a careful human, 1 the scenario's.")] = 1.0,
    view: Annotated[int, typer.Option(help="Which view of the range finder the picture shows, from 1.")] = 1,
    out: Annotated[Path | None, typer.Option(help="Draw every stage of seeing into this file: .png.")] = None,
    as_json: AsJson = False,
) -> None:
    """Watch a demonstration with a range finder: what moved, which part it was, where it went."""
    from apo_bench.viz.sensor import checked_view, run_sensor, sensor_form, sensor_table

    check_outputs([(out, "--out", (".png",))])
    drawn_view = checked_view(view)
    sensor_run = run_sensor(scenario, noise_level, seed, human_error_scale)
    form = sensor_form(sensor_run, noise_level, seed, human_error_scale)
    if out is not None:
        from apo_bench.viz.sensor_picture import draw_sensor

        draw_sensor(sensor_run, out, drawn_view)
    if as_json:
        print_json(form)
    else:
        console(140).print(sensor_table(form))
    if out is not None:
        say(f"\nWrote {out}", as_json)
    if not all(operation["found"] for operation in form["operations"]):
        raise typer.Exit(NO_RESULT)
