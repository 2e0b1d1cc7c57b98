"""The commands `apo-bench scenario list | show | new | check`."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from apo_bench.cli.shared import (
    NO_RESULT,
    Command,
    ScenarioArgument,
    check_output,
    make_group,
    make_path_argument,
    make_path_option,
    print_columns,
)
from apo_bench.records import SETTINGS, check

if TYPE_CHECKING:
    from apo_bench.importers.assembly.choices import AssemblyChoices

_HELP = """
Scenarios: the tasks that human and robot do.

Examples:
  apo-bench scenario list
  apo-bench scenario show pocket_table
"""
commands = make_group("scenario", _HELP)
Up = Annotated[
    str | None,
    typer.Option(help="Axis of the poses that points up: x, y, z, -x, -y or -z; default: z, or what works better."),
]
Fixed = Annotated[
    list[str] | None,
    typer.Option(help="Part that never moves; may be repeated; default: the largest of the lowest parts."),
]
Order = Annotated[str | None, typer.Option(help="Order of the parts, with commas; default: an order that works.")]
ClearanceMm = Annotated[float, typer.Option(min=0.0, max=5.0, help="Clearance per side of faces that fit, mm.")]
Fits = Annotated[
    Literal["auto", "ask", "refuse"],
    typer.Option(help="Parts drawn without play: auto gives them the clearance, ask lists them, refuse keeps them."),
]
MaxOverlapMm = Annotated[
    float,
    typer.Option(min=0.0, max=1.0, help="Add the clearance where parts overlap by up to this depth, mm."),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace --out and its parts.")]


@commands.command("list", cls=Command)
def scenario_list() -> None:
    """List the scenarios that come with the package; generated:SEED names any number of others.

    Examples:
      apo-bench scenario list
      apo-bench run generated:17 --seed 3
    """
    from apo_bench.io import read_typed
    from apo_bench.scenario.scenario_file import find_scenario_path, list_scenario_names
    from apo_bench.scenario.tables import ScenarioTable

    tables = {
        name: read_typed(find_scenario_path(name), ScenarioTable, "scenario file") for name in list_scenario_names()
    }
    rows = [(name, str(len(table.operations)), table.title, table.paper) for name, table in tables.items()]
    print_columns([("scenario", "operations", "title", "paper"), *rows])


@commands.command("show", cls=Command)
def scenario_show(scenario: ScenarioArgument) -> None:
    """Print the task sheet of a scenario, and check its file.

    Examples:
      apo-bench scenario show pocket_table
      apo-bench scenario show generated:bridges:17
    """
    from apo_bench import load_scenario
    from apo_bench.viz.task_sheet import write_task_sheet

    typer.echo(write_task_sheet(load_scenario(scenario)), nl=False)


@commands.command("new", cls=Command)
def scenario_new(
    parts: Annotated[
        list[str] | None,
        typer.Argument(metavar="PART", help="Part files; default: as named in --poses, next to it."),
    ] = None,
    *,
    poses: Annotated[Path, make_path_option("File of [[pose]]: the final pose of every part.")],
    out: Annotated[Path, make_path_option("Write the scenario: .toml.")],
    up: Up = None,
    fixed: Fixed = None,
    order: Order = None,
    clearance_mm: ClearanceMm = 0.25,
    max_overlap_mm: MaxOverlapMm = 1.0,
    fits: Fits = "auto",
    overwrite: Overwrite = False,
) -> None:
    """Make a scenario from parts at their final poses: contacts, an order, starts and grasps, each with a comment.

    Examples:
      apo-bench scenario new --poses poses.toml --out pile.toml
      apo-bench scenario new block stick --poses poses.toml --fixed lower --out pile.toml
    """
    from apo_bench.importers.assembly.choices import AssemblyChoices

    check_output(out, "--out", ".toml", new=not overwrite)
    names = parse_names(order)
    choices = AssemblyChoices(up, tuple(fixed or ()), names, clearance_mm, max_overlap_mm, fits)
    write_new_scenario(poses, parts or [], poses.name, out, choices)


def parse_names(text: str | None) -> tuple[str, ...]:
    """Return the names in a list with commas."""
    return tuple(name.strip() for name in text.split(",")) if text else ()


def write_new_scenario(
    poses: Path, parts: list[str], source: str, out: Path, choices: "AssemblyChoices", notes: Sequence[str] = ()
) -> None:
    """Choose what poses leave open, and write the scenario file.

    Args:
        source: Name of what the poses come from.
        notes: Sentences about the parts, for the file; they were printed already.
    """
    from apo_bench import load_scenario
    from apo_bench.importers.assembly.from_poses import scenario_from_poses
    from apo_bench.importers.assembly.scenario_writer import list_choices

    made = scenario_from_poses(poses, parts, out, source, choices, notes)
    typer.echo("\n".join(list_choices(made)))
    load_scenario(out)
    typer.echo(f"Wrote {out}; next: apo-bench scenario check {shlex.quote(str(out))}")


@commands.command("check", cls=Command)
def scenario_check(
    file: Annotated[Path, make_path_argument("FILE", "A scenario file.")],
    seeds: Annotated[int, typer.Option(min=0, max=1000, help="Trials with the true poses.")] = 5,
    fidelity: Annotated[str, typer.Option(help="Fidelity of these trials: full, or near-contact.")] = "full",
    arm: Annotated[str, typer.Option(help="Arm, as in `arm check`.")] = SETTINGS["arm"].default,
) -> None:
    """Check whether human and robot can do a scenario, and name the line of its file to change if not.

    Examples:
      apo-bench scenario check own.toml
      apo-bench scenario check own.toml --arm ur5e_primitive --seeds 20
    """
    from apo_bench.importers.assembly.scenario_check import check_file

    check("fidelity", fidelity)
    passed = True
    for finding in check_file(file, seeds, fidelity, arm):
        typer.echo(finding)
        passed &= finding.ok
    if not passed:
        raise typer.Exit(NO_RESULT)
