"""The command `apo-bench inspect depth`: poses estimated from depth images of a demonstration."""

from pathlib import Path
from typing import Annotated

import typer

from apo_bench.cli.shared import (
    NO_RESULT,
    AsJson,
    ScenarioArgument,
    check_output,
    make_path_option,
    print_json,
    print_table,
    print_written,
)


def depth_command(
    scenario: ScenarioArgument,
    noise_mm: Annotated[float, typer.Option(help="Standard deviation of one ray, in mm.")] = 1.0,
    seed: Annotated[int, typer.Option(help="Number of the demonstration.")] = 0,
    human_error_scale: Annotated[float, typer.Option(help="Factor on the human error of the scenario.")] = 1.0,
    view: Annotated[int, typer.Option(min=1, max=2, help="View of the depth camera in the picture.")] = 1,
    out: Annotated[Path | None, make_path_option("Draw every stage of the estimation into this file: .png.")] = None,
    as_json: AsJson = False,
) -> None:
    """Estimate the poses of a demonstration from simulated depth images: what moved, which part, where to.

    Examples:
      apo-bench inspect depth stick_in_tower --seed 7
      apo-bench inspect depth stick_in_tower --seed 7 --noise-mm 2 --out depth.png
    """
    from apo_bench.viz.depth_picture import draw_depth
    from apo_bench.viz.depth_run import DEPTH_COLUMNS, make_depth_form, run_depth_camera
    from apo_bench.viz.form_text import make_table

    check_output(out, "--out", ".png")
    run = run_depth_camera(scenario, noise_mm, seed, human_error_scale)
    form = make_depth_form(run, noise_mm, seed, human_error_scale)
    if out is not None:
        draw_depth(run, out, view - 1)
    if as_json:
        print_json(form)
    else:
        print_table(make_table(form["operations"], DEPTH_COLUMNS), 140)
    print_written(out, as_json=as_json)
    if not all(operation["found"] for operation in form["operations"]):
        raise typer.Exit(NO_RESULT)
