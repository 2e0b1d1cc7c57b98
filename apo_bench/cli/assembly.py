"""The command `apo-bench assembly import`: CAD files become a scenario."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from apo_bench.cli.part import Density
from apo_bench.cli.scenario import (
    ClearanceMm,
    Fits,
    Fixed,
    MaxOverlapMm,
    Order,
    Overwrite,
    Up,
    parse_names,
    write_new_scenario,
)
from apo_bench.cli.shared import Command, check_output, make_group, make_path_option, parse_path

_HELP = """
Assemblies from CAD files.

Examples:
  apo-bench assembly import jig.step --out jig.toml
  apo-bench assembly import jig.stl --unit mm --out jig.toml
"""
commands = make_group("assembly", _HELP)


@commands.command("import", cls=Command)
def assembly_import(
    files: Annotated[
        list[Path],
        typer.Argument(
            parser=parse_path, metavar="FILE", help="A CAD file of several solids, or several files in one frame."
        ),
    ],
    *,
    out: Annotated[Path, make_path_option("Write the scenario: .toml; its parts are in a folder next to it.")],
    unit: Annotated[
        str | None, typer.Option(help="Unit of the files: mm, in, m, cm, ft or um; default: as they state.")
    ] = None,
    up: Up = None,
    fixed: Fixed = None,
    order: Order = None,
    clearance_mm: ClearanceMm = 0.25,
    max_overlap_mm: MaxOverlapMm = 1.0,
    fits: Fits = "auto",
    fasteners: Annotated[
        Literal["clamp", "parts"],
        typer.Option(
            help="clamp leaves screws and nuts out and fixes what only they hold; parts treats them as parts."
        ),
    ] = "clamp",
    density: Density = 1000.0,
    skip: Annotated[list[str] | None, typer.Option(help="Name of a solid to leave out; may be repeated.")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Make a scenario from CAD files: parts, contacts, an order, starts and grasps.

    Examples:
      apo-bench assembly import jig.step --out jig.toml
      apo-bench assembly import base.step key.step pin.step --order key,pin --out clamp.toml
    """
    from apo_bench.importers.assembly.choices import AssemblyChoices
    from apo_bench.importers.assembly.from_cad import import_parts, remove_on_failure

    check_output(out, "--out", ".toml", new=not overwrite)
    choices = AssemblyChoices(
        up,
        tuple(fixed or ()),
        parse_names(order),
        clearance_mm,
        max_overlap_mm,
        fits,
        fasteners,
        density,
        tuple(skip or ()),
    )
    with remove_on_failure(out.with_name(f"{out.stem}_parts")) as folder:
        made = import_parts(files, folder, unit, choices, typer.echo)
        typer.echo(f"Wrote {made.poses} and its parts")
        source = ", ".join(file.name for file in files)
        write_new_scenario(made.poses, [], source, out, choices, made.notes)
