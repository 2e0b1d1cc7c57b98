"""The command `apo-bench part import`: a CAD file becomes part files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from apo_bench.cli.arguments import path_given
from apo_bench.errors import InputError

part = typer.Typer(add_completion=False, rich_markup_mode=None, help="Parts from CAD files.")


def register(app: typer.Typer) -> None:
    """Add the commands to the command line."""
    app.add_typer(part, name="part")


@part.callback()
def _group() -> None:
    """Parts from CAD files."""


@part.command("import")
def import_file(
    file: Annotated[Path, typer.Argument(help="A file of triangles: .stl, .obj or .3mf.", parser=path_given)],
    out: Annotated[Path, typer.Option(help="The folder for the part files and their pictures; made if needed.")],
    unit: Annotated[
        str | None, typer.Option(help="Of the numbers in the file: mm, in, m, cm, ft, um; default: as it states.")
    ] = None,
    name: Annotated[
        list[str] | None, typer.Option(help="Another name for a face, such as hole1=bore; may be given again.")
    ] = None,
    density: Annotated[float, typer.Option(help="In kg/m^3.")] = 1000.0,
) -> None:
    """Make part files from a CAD file: find its faces, cut it into convex pieces, and say what was done."""
    from apo_bench.cad.importing import import_part, part_name, raw_solids, with_new_names
    from apo_bench.show.part_picture import draw_part
    from apo_bench.show.part_text import import_lines, unit_line

    names = _pairs(name or [])
    if not 1.0 <= density <= 25_000.0:
        raise InputError(f"--density {density:g} was given; 1 to 25000 kg/m^3 are allowed.")
    source, raws = raw_solids(file, unit)
    if names and len(raws) > 1:
        raise InputError(
            f"--name was given, and {file} holds {len(raws)} different solids; import them from files of their own."
        )
    raws = [with_new_names(raw, names) for raw in raws]
    try:
        out.mkdir(parents=True, exist_ok=True)
        typer.echo(f"{file}: {unit_line(source)}")
        used: set[str] = set()
        for raw in raws:
            called = part_name(raw.name)
            while called in used:
                called += "_"
            used.add(called)
            done = import_part(raw, called, out, file.name, density)
            typer.echo("\n".join(import_lines(done)))
            picture = done.path.with_suffix(".png")
            draw_part(raw, frozenset(done.refused), called, picture)
            typer.echo(f"Wrote {done.path} and {picture}")
    except OSError as error:
        raise InputError(f"--out {out} cannot be written ({error.strerror}); choose another place.") from error


def _pairs(given: list[str]) -> Mapping[str, str]:
    """`hole1=bore` as old and new names."""
    found: dict[str, str] = {}
    for each in given:
        old, equals, new = each.partition("=")
        if not (old and equals and new) or old in found:
            raise InputError(f"--name {each} was given; FACE=NEW is allowed, each face once, such as hole1=bore.")
        found[old] = new
    return found
