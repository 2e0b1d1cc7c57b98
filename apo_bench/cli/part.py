"""The command `apo-bench part import`: a CAD file becomes part files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from apo_bench.cli.arguments import path_given, writing
from apo_bench.cli.help_groups import Grouped
from apo_bench.cli.printing import print_json
from apo_bench.cli.setting_options import AsJson
from apo_bench.errors import InputError, require

if TYPE_CHECKING:
    from apo_bench.cad.importing import Imported
    from apo_bench.cad.solids.raw_solid import RawSolid

part = typer.Typer(name="part", cls=Grouped, rich_markup_mode=None, help="Parts from CAD files.")


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
    from apo_bench.cad.import_report import named_places, report_form, unit_line, write_places
    from apo_bench.cad.importing import raw_solids
    from apo_bench.cad.solids.naming import renamed

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
    raws = [renamed(raw, names) for raw in raws]
    with writing(f"--out {out}"):
        out.mkdir(parents=True, exist_ok=True)
        _say(f"{file}: {unit_line(source)}", as_json)
        imported, left_out = _written(file, raws, out, density, as_json)
        left_out = [*source.left_out, *left_out]
        places = named_places({each.path.stem: each.raw.places for each in imported})
        poses = write_places(places, out, file.name) if len(places) > 1 else None
    if poses is not None:
        _say(f"Wrote {poses}: {len(places)} places of {len(imported)} parts", as_json)
    if as_json:
        print_json(report_form(source, file, imported, poses))
    require(not left_out, f"{file}: {len(left_out)} of its solids became no parts: {' '.join(left_out)}")


def _written(
    file: Path, raws: Sequence[RawSolid], out: Path, density: float, as_json: bool
) -> tuple[list[Imported], list[str]]:
    """Parts with their pictures; and why others of the file became none."""
    from apo_bench.cad.import_report import import_lines
    from apo_bench.cad.importing import import_part
    from apo_bench.cad.part_picture import draw_part
    from apo_bench.cad.solids.naming import free_name, part_name

    imported: list[Imported] = []
    left_out: list[str] = []
    used: set[str] = set()
    for raw in raws:
        called = free_name(part_name(raw.name), used)
        used.add(called)
        try:
            each = import_part(raw, called, out, file.name, density)
        except InputError as error:
            if len(raws) == 1:
                raise
            left_out.append(f"{called}: {str(error).removeprefix(f'{file.name}: ')}")
            _say(f"{called}: NO PART", as_json)
            continue
        imported.append(each)
        _say("\n".join(import_lines(each)), as_json)
        picture = each.path.with_suffix(".png")
        draw_part(raw, frozenset(each.refused), called, picture)
        _say(f"Wrote {each.path} and {picture}", as_json)
    return imported, left_out


def _say(text: str, as_json: bool) -> None:
    if not as_json:
        typer.echo(text)


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
