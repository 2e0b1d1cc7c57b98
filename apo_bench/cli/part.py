"""The commands `apo-bench part`: import parts from CAD files, and export parts to print."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.shared import (
    AsJson,
    Command,
    ScenarioArgument,
    make_group,
    make_path_argument,
    make_path_option,
    name_write_errors,
    print_json,
    print_text,
)
from apo_bench.errors import InputError, require
from apo_bench.io import read_text
from apo_bench.scenario.parts.limits import LARGEST_PART_BYTES

_HELP = """
Parts from CAD files, and parts to print.

Examples:
  apo-bench part import bracket.step --out parts
  apo-bench part export stick_in_tower --clearance-mm 0.3 --out kit
"""
commands = make_group("part", _HELP)
Density = Annotated[float, typer.Option(min=1.0, max=25_000.0, help="Density in kg/m^3.")]


@commands.command("import", cls=Command)
def part_import(
    file: Annotated[Path, make_path_argument("FILE", "A CAD file: .step, .stp, .stl, .obj or .3mf.")],
    out: Annotated[Path, make_path_option("Folder of the part files and their pictures.")],
    unit: Annotated[
        str | None, typer.Option(help="Unit of the file: mm, in, m, cm, ft or um; default: as the file states.")
    ] = None,
    name: Annotated[list[str] | None, typer.Option(help="Rename a face, such as hole1=bore; may be repeated.")] = None,
    density: Density = 1000.0,
    round_sides: Annotated[
        int,
        typer.Option(
            "--min-round-sides",
            min=5,
            max=64,
            help="Of a mesh: smallest number of flat sides around an axis that make a round face.",
        ),
    ] = 12,
    as_json: AsJson = False,
) -> None:
    """Make part files from a CAD file: find its faces, and cut it into convex pieces.

    Examples:
      apo-bench part import bracket.step --out parts
      apo-bench part import bracket.stl --unit mm --name hole1=bore --out parts
    """
    from apo_bench.importers.cad.part_import import read_raw_solids
    from apo_bench.importers.cad.part_report import format_file_report, report_file
    from apo_bench.importers.cad.pose_file import name_places, write_places
    from apo_bench.importers.cad.solids.naming import rename_faces

    names = _parse_names(name or [])
    source, solids = read_raw_solids(file, unit, round_sides)
    require(
        not names or len(solids) <= 1,
        f"--name renames the faces of one solid, and {file} holds {len(solids)}; import each from its own file.",
    )
    with name_write_errors(f"--out {out}"):
        out.mkdir(parents=True, exist_ok=True)
        print_text("\n".join(format_file_report(source, file)), as_json)
        imported, refused = _import_solids(file, [rename_faces(raw, names) for raw in solids], out, density, as_json)
        places = name_places({part.path.stem: part.raw.places for part in imported})
        poses = write_places(places, out, file.name) if len(places) > 1 else None
    if poses is not None:
        print_text(f"Wrote {poses}: {len(places)} places of {len(imported)} parts", as_json)
    if as_json:
        print_json(report_file(source, file, imported, poses))
    refused = [*source.left_out, *refused]
    require(not refused, f"{file}: {len(refused)} of its solids became no parts: {' '.join(refused)}")


@commands.command("export", cls=Command)
def part_export(
    scenario: ScenarioArgument,
    out: Annotated[Path, make_path_option("Folder of the kit.")],
    clearance_mm: Annotated[
        float | None,
        typer.Option(min=0.0, max=5.0, help="Clearance of your printer, per side, in mm; default: as the scenario."),
    ] = None,
    form_trials: Annotated[int, typer.Option(min=1, max=1000, help="Number of trials in the form.")] = 20,
    method: Annotated[list[str] | None, typer.Option(help="Method to name in the form; may be repeated.")] = None,
    step_files: Annotated[
        bool, typer.Option("--step-files", help="Write STEP files as well; needs the extra cad.")
    ] = False,
) -> None:
    """Write a kit for a real robot: parts and a plate to print (STL), places of tags, and a form for the results.

    Examples:
      apo-bench part export stick_in_tower --clearance-mm 0.3 --out kit
      apo-bench part export pocket_table --step-files --form-trials 30 --method uncorrected --method contact --out kit
    """
    from apo_bench.formats.kit import write_kit
    from apo_bench.scenario import load_scenario

    task = load_scenario(scenario)
    clearance = task.clearance_mm if clearance_mm is None else clearance_mm
    with name_write_errors(f"--out {out}"):
        files = write_kit(task, clearance, out, method or ["uncorrected", "contact"], form_trials, step_files)
    for file, count in files.items():
        typer.echo(f"{file}: print {count}")
    typer.echo(f"{out / 'tags.csv'}: where tags lie on the plate; {out / 'form.csv'}: fill in, one line a trial")


def _import_solids(
    file: Path, solids: Sequence[Any], out: Path, density: float, as_json: bool
) -> tuple[list[Any], list[str]]:
    """Parts with their pictures, and the reasons why other solids became none."""
    from apo_bench.importers.cad.fallback import import_solid_anyway
    from apo_bench.importers.cad.part_picture import draw_part
    from apo_bench.importers.cad.part_report import format_part_report, report_part
    from apo_bench.importers.cad.solids.naming import clean_title, make_part_name

    imported: list[Any] = []
    refused: list[str] = []
    used: set[str] = set()
    for raw in solids:
        stem = make_part_name(raw.name, used | _find_others(out, clean_title(raw.name)))
        used.add(stem)
        try:
            part = import_solid_anyway(raw, stem, out, file.name, density)
        except InputError as error:
            if len(solids) == 1:
                raise
            refused.append(f"{stem}: {str(error).removeprefix(f'{file.name}: ')}")
            continue
        imported.append(part)
        picture = out / f"{stem}.png"
        draw_part(part.raw, part.refused, stem, picture)
        print_text("\n".join([*format_part_report(report_part(part)), f"Wrote {part.path} and {picture}"]), as_json)
    return imported, refused


def _find_others(out: Path, title: str) -> set[str]:
    """Numbered parts in a folder that have another title: the import of another file must not replace them."""
    others = set()
    for file in out.glob("part_*.xml"):
        texts = [read_text(f, "part file", LARGEST_PART_BYTES) for f in (file, file.with_suffix(".toml")) if f.exists()]
        others |= set() if title in "".join(texts) else {file.stem}
    return others


def _parse_names(renamings: list[str]) -> Mapping[str, str]:
    """`hole1=bore` as old and new names."""
    pairs = [renaming.partition("=") for renaming in renamings]
    for (old, _, new), renaming in zip(pairs, renamings, strict=True):
        require(old and new, f"--name must be FACE=NEW, such as hole1=bore, got {renaming}.")
    names = {old: new for old, _, new in pairs}
    require(len(names) == len(pairs), "--name may rename each face once; remove the second one.")
    return names
