"""The commands `apo-bench arm`: list robot arms, and check one at the table."""

from pathlib import Path
from typing import Annotated

import typer

from apo_bench.cli.shared import Command, check_output, make_group, make_path_option, print_columns, print_written

_HELP = """
Robot arms.

Examples:
  apo-bench arm list
  apo-bench arm check ur5e_primitive peg_in_hole --layouts 3
"""
commands = make_group("arm", _HELP)


@commands.command("list", cls=Command)
def arm_list() -> None:
    """List the arms that come with the package, and how to name others.

    Examples:
      apo-bench arm list
      apo-bench run stick_in_tower --arm ur5e_primitive
    """
    from apo_bench.simulation.arms.finding import arm_names, find_arm
    from apo_bench.viz.arm_text import describe_arm

    print_columns([(name, describe_arm(find_arm(name))) for name in arm_names()])
    typer.echo("\nOthers: FILE.toml, menagerie:NAME (MuJoCo Menagerie), robosuite:NAME, or package.module:name")


@commands.command("check", cls=Command)
def arm_check(
    name: Annotated[
        str, typer.Argument(metavar="ARM", help="A name from `arm list`, FILE.toml, menagerie:NAME or robosuite:NAME.")
    ],
    scenario: Annotated[str, typer.Argument(metavar="SCENARIO", help="Scenario by name or file.")] = "stick_in_tower",
    layouts: Annotated[int, typer.Option(min=1, max=1000, help="Number of layouts to check.")] = 20,
    out: Annotated[Path | None, make_path_option("Draw the arm at the table into this file: .png.")] = None,
) -> None:
    """Measure what an arm can do at the table: reach, errors of its tip, stiffness, gripper, joint limits.

    Examples:
      apo-bench arm check ur5e_primitive peg_in_hole --layouts 3
      apo-bench arm check my_arm.toml --out arm.png
    """
    from apo_bench import load_scenario
    from apo_bench.simulation.arm_checks.arm_check import check_arm
    from apo_bench.simulation.arms.finding import find_arm
    from apo_bench.viz.arm_picture import draw_arm
    from apo_bench.viz.arm_text import arm_check_form
    from apo_bench.viz.form_text import list_facts

    check_output(out, "--out", ".png")
    task = load_scenario(scenario)
    arm = find_arm(name)
    checked = check_arm(arm, task, layouts)
    if out is not None:
        draw_arm(arm, task, out)
    print_columns(list_facts(arm_check_form(checked)))
    print_written(out)
