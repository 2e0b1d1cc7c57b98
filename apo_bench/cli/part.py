"""The command `apo-bench part import`: a CAD file becomes part files.

The commands `apo-bench arm list | check`: which arms there are, and what one can do at the table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from apo_bench.cli.arguments import AsJson
from apo_bench.cli.help import group
from apo_bench.cli.outputs import check_outputs, writing
from apo_bench.cli.printing import print_json, say
from apo_bench.cli.values import path_given
from apo_bench.errors import InputError, require
from apo_bench.io import check_target, read_text, write_file
from apo_bench.scenario.file import load_scenario
from apo_bench.scenario.parts.allowed import LARGEST_PART_BYTES

if TYPE_CHECKING:
    from apo_bench.importers.cad.importing import ImportedPart
    from apo_bench.importers.cad.solids.raw_solid import RawSolid

part = group("part", "Parts from CAD files.")


@part.command("import")
def part_import(
    file: Annotated[Path, typer.Argument(help="A CAD file: .step, .stp, .stl, .obj or .3mf.", parser=path_given)],
    out: Annotated[Path, typer.Option(help="The folder for the part files and their pictures; made if needed.")],
    unit: Annotated[
        str | None, typer.Option(help="Of the numbers in the file: mm, in, m, cm, ft, um; default: as it states.")
    ] = None,
    name: Annotated[
        list[str] | None, typer.Option(help="Another name for a face, such as hole1=bore; may be given again.")
    ] = None,
    density: Annotated[float, typer.Option(help="In kg/m^3.")] = 1000.0,
    fewest_sides: Annotated[
        int | None,
        typer.Option("--round", help="Of a mesh: take so many flat sides in a turn, and more, for round; default: 12."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Make part files from a CAD file: find its faces, cut it into convex pieces, and say what was done."""
    from apo_bench.importers.cad.importing import raw_solids
    from apo_bench.importers.cad.part_report import file_lines, report_file
    from apo_bench.importers.cad.places import named_places, write_places
    from apo_bench.importers.cad.solids.naming import rename_faces

    names = _pairs(name or [])
    require(1.0 <= density <= 25_000.0, f"--density {density:g} was given; 1 to 25000 kg/m^3 are allowed.")
    require(
        fewest_sides is None or 5 <= fewest_sides <= 64, f"--round {fewest_sides} was given; 5 to 64 sides are allowed."
    )
    source, raws = raw_solids(file, unit, *(() if fewest_sides is None else (fewest_sides,)))
    require(
        not names or len(raws) <= 1,
        f"--name was given, and {file} holds {len(raws)} different solids; import them from files of their own.",
    )
    raws = [rename_faces(raw, names) for raw in raws]
    with writing(f"--out {out}"):
        out.mkdir(parents=True, exist_ok=True)
        say("\n".join(file_lines(source, file)), as_json)
        imported, left_out = _written(file, raws, out, density, as_json)
        left_out = [*source.left_out, *left_out]
        places = named_places({each.path.stem: each.raw.places for each in imported})
        poses = write_places(places, out, file.name) if len(places) > 1 else None
    if poses is not None:
        say(f"Wrote {poses}: {len(places)} places of {len(imported)} parts", as_json)
    if as_json:
        print_json(report_file(source, file, imported, poses))
    require(not left_out, f"{file}: {len(left_out)} of its solids became no parts: {' '.join(left_out)}")


def _written(
    file: Path, raws: Sequence[RawSolid], out: Path, density: float, as_json: bool
) -> tuple[list[ImportedPart], list[str]]:
    """Parts with their pictures; and why others of the file became none."""
    from apo_bench.importers.cad.importing import import_part
    from apo_bench.importers.cad.part_picture import draw_part
    from apo_bench.importers.cad.part_report import part_lines, report_part
    from apo_bench.importers.cad.solids.naming import part_name, clean_title

    imported: list[ImportedPart] = []
    left_out: list[str] = []
    used: set[str] = set()
    for raw in raws:
        called = part_name(raw.name, used | _of_others(out, clean_title(raw.name)))
        used.add(called)
        picture = out / f"{called}.png"
        for path in (picture, *(out / f"{called}{ending}" for ending in (".xml", ".toml"))):
            check_target(path)
        try:
            each = import_part(raw, called, out, file.name, density)
        except InputError as error:
            if len(raws) == 1:
                raise
            left_out.append(f"{called}: {str(error).removeprefix(f'{file.name}: ')}")
            say(f"{called}: NO PART", as_json)
            continue
        imported.append(each)
        draw_part(each.raw, each.refused, called, picture)
        say("\n".join([*part_lines(report_part(each)), f"Wrote {each.path} and {picture}"]), as_json)
    return imported, left_out


def _of_others(out: Path, title: str) -> set[str]:
    """Numbered parts in a folder that have another title: an import of another file does not replace them."""
    files = sorted(out.glob("part_*.xml"))
    texts = {file: read_text(file, "part file", LARGEST_PART_BYTES) for file in files}
    for file in files:
        stated = file.with_suffix(".toml")
        if stated.exists():
            texts[file] += read_text(stated, "file that states the faces of a part", LARGEST_PART_BYTES)
    return {file.stem for file, text in texts.items() if title not in text}


def _pairs(renamings: list[str]) -> Mapping[str, str]:
    """`hole1=bore` as old and new names."""
    names: dict[str, str] = {}
    for renaming in renamings:
        old, equals, new = renaming.partition("=")
        require(
            old and equals and new and old not in names,
            f"--name {renaming} was given; FACE=NEW is allowed, each face once, such as hole1=bore.",
        )
        names[old] = new
    return names


arm = group("arm", "Arms: those that come along, and any other.")

_SIZE = (960, 720)
_WHOLE_TABLE = (np.array([-0.15, 0.0, 0.3]), 1.9, 140.0, -18.0)
"""A view of the whole arm and the table."""


@arm.command("list")
def arm_list() -> None:
    """List the arms that come with the benchmark, and how others are named."""
    from apo_bench.simulation.arms.finding import arm_names, find_arm
    from apo_bench.viz.arm_text import list_line

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
        str, typer.Argument(help="A name out of `apo-bench scenario list`, or a scenario file.")
    ] = "stick_in_tower",
    layouts: Annotated[int, typer.Option(min=1, max=1000, help="How many layouts are looked at.")] = 20,
    out: Annotated[Path | None, typer.Option(help="Draw it at the table into this file: .png.")] = None,
) -> None:
    """Say what an arm can do at the table: reach, errors of its tip, stiffness, gripper, room along a plan."""
    from apo_bench.simulation.arm_checks.arm_check import check_arm
    from apo_bench.simulation.arms.finding import find_arm
    from apo_bench.viz.arm_text import check_lines

    check_outputs([(out, "--out", (".png",))])
    loaded = load_scenario(scenario)
    robot = find_arm(name)
    checked = check_arm(robot, loaded, layouts)
    if out is not None:
        import imageio.v3 as imageio

        from apo_bench.simulation.scene.render import camera_view, picture_with_arm
        from apo_bench.simulation.scene.scene import build_scene

        scene = build_scene(loaded, arm=robot, grasp="weld")
        image = picture_with_arm(scene, loaded.start, None, *_SIZE, camera_view(*_WHOLE_TABLE))
        write_file(out, imageio.imwrite("<bytes>", image, extension=".png"))
    typer.echo(f"{name} at the table of {loaded.name}:")
    for line in check_lines(checked):
        typer.echo(f"  {line}")
    if out is not None:
        typer.echo(f"Wrote {out}")
