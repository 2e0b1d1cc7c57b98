"""The commands `apo-bench arm list | check`: which arms there are, and what one can do at the table."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from apo_bench.cli.arguments import check_outputs
from apo_bench.cli.help_groups import Grouped
from apo_bench.scenario.file import load_scenario

arm = typer.Typer(name="arm", cls=Grouped, rich_markup_mode=None, help="Arms: those that come along, and any other.")

_SIZE = (960, 720)
_WHOLE_TABLE = (np.array([-0.15, 0.0, 0.3]), 1.9, 140.0, -18.0)
"""A view of the whole arm and the table."""


@arm.command("list")
def arm_list() -> None:
    """List the arms that come with the benchmark, and how others are named."""
    from apo_bench.show.arm_text import list_line
    from apo_bench.simulation.arms.finding import arm_names, find_arm

    for name in arm_names():
        typer.echo(list_line(name, find_arm(name)))
    typer.echo(
        "any other: FILE.toml, menagerie:NAME (as in MuJoCo Menagerie), robosuite:NAME, or package.module:name; "
        "`apo-bench arm check` says what it can do"
    )


@arm.command("check")
def arm_check(
    name: Annotated[str, typer.Argument(metavar="ARM", help="A name, FILE.toml, menagerie:NAME or robosuite:NAME.")],
    scenario: Annotated[
        str, typer.Argument(help="A name out of `apo-bench scenarios`, or a scenario file.")
    ] = "stick_in_tower",
    layouts: Annotated[int, typer.Option(min=1, max=1000, help="How many layouts are looked at.")] = 20,
    out: Annotated[Path | None, typer.Option(help="Draw it at the table into this file: .png.")] = None,
) -> None:
    """Say what an arm can do at the table: reach, errors of its tip, stiffness, gripper, room along a plan."""
    from apo_bench.show.arm_text import check_lines
    from apo_bench.simulation.arm_checks.arm_check import check_arm
    from apo_bench.simulation.arms.finding import find_arm

    check_outputs([(out, "--out", (".png",))])
    loaded = load_scenario(scenario)
    robot = find_arm(name)
    typer.echo(f"{name} at the table of {loaded.name}:")
    for line in check_lines(check_arm(robot, loaded, layouts)):
        typer.echo(f"  {line}")
    if out is not None:
        import imageio.v3 as imageio

        from apo_bench.simulation.scene.render import camera_view, picture_with_arm
        from apo_bench.simulation.scene.scene import build_scene

        scene = build_scene(loaded, arm=robot, grasp="weld")
        imageio.imwrite(out, picture_with_arm(scene, loaded.start, None, *_SIZE, camera_view(*_WHOLE_TABLE)))
        typer.echo(f"Wrote {out}")
