"""Import CAD files by a Python call: `import_part` and `import_assembly`, as the commands of these names do."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from apo_bench.arguments import check_arguments
from apo_bench.errors import require
from apo_bench.scenario import Scenario, find_scenario_path, load_scenario


@check_arguments
def import_part(file: str | Path, folder: str | Path, *, unit: str | None = None) -> tuple[Path, ...]:
    """Make part files from a CAD file: find its faces, and cut its solids into convex pieces.

    Args:
        file: A file that ends in .step, .stp, .stl, .obj or .3mf; STEP needs the extra `cad`.
        folder: Where the part files are written.
        unit: Unit of the file: mm, in, m, cm, ft or um. Default: as the file states.

    Returns:
        The part files (.xml), which scenario files name; round faces are in a TOML file next to each.

    Raises:
        InputError: The file cannot be read, or a solid makes no part.

    Examples:
        >>> import apo_bench, tempfile, trimesh
        >>> folder = tempfile.mkdtemp()
        >>> mesh = trimesh.creation.box((60, 40, 20)).export(f"{folder}/plate.stl")
        >>> [file.name for file in apo_bench.import_part(f"{folder}/plate.stl", folder, unit="mm")]
        ['plate.xml']
    """
    from apo_bench.importers.cad.fallback import import_solid_anyway
    from apo_bench.importers.cad.part_import import read_raw_solids
    from apo_bench.importers.cad.solids.naming import make_part_name

    source, target = Path(file), Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    written: dict[str, Path] = {}
    for raw in read_raw_solids(source, unit)[1]:
        name = make_part_name(raw.name, set(written))
        written[name] = import_solid_anyway(raw, name, target, source.name).path
    return tuple(written.values())


@check_arguments
def import_assembly(
    files: str | Path | Sequence[str | Path],
    out: str | Path | None = None,
    *,
    unit: str | None = None,
    up: str | None = None,
    fixed: Sequence[str] = (),
    order: Sequence[str] = (),
    clearance_mm: float = 0.25,
    max_overlap_mm: float = 1.0,
    fits: Literal["auto", "ask", "refuse"] = "auto",
    fasteners: Literal["clamp", "parts"] = "clamp",
    density: float = 1000.0,
    skip: Sequence[str] = (),
) -> Scenario:
    """Make a scenario from CAD files: parts, contacts, an order, starts and grasps.

    Args:
        files: One file of several solids, or several files in one frame.
        out: The scenario file (.toml); its parts are in a folder next to it. Default: `NAME.toml` in the current
            folder, where NAME is that of the first file.
        unit: Unit of the files: mm, in, m, cm, ft or um. Default: as they state.
        up: The axis of the files that is up: x, y, z, -x, -y or -z. Default: z, or one that has an order.
        fixed: Parts that stay where they are. Default: the largest of the lowest.
        order: The moved parts in their order. Default: one that is found.
        clearance_mm: Clearance per side between parts that fit.
        max_overlap_mm: Largest depth by which faces recede where parts overlap in the files.
        fits: `auto` gives parts that overlap or were drawn without play the clearance; `ask` lists them as an error;
            `refuse` changes nothing.
        fasteners: `clamp` leaves screws, nuts, washers and inserts out, and fixes a part that only they hold where it
            is placed; `parts` treats them as parts.
        density: Density of all parts, [kg/m^3].
        skip: Names of solids to leave out.

    Returns:
        The scenario; its file can be edited, and `load_scenario` reads it again.

    Raises:
        InputError: A file cannot be read, fewer than two solids make parts, or the scenario file exists.
        RuntimeError: There is no order in which the parts can be assembled.

    Examples:
        >>> import apo_bench, tempfile, trimesh
        >>> folder = tempfile.mkdtemp()
        >>> plate, block = trimesh.creation.box((60, 50, 20)), trimesh.creation.box((30, 30, 40))
        >>> files = [f"{folder}/plate.stl", f"{folder}/block.stl"]
        >>> meshes = plate.export(files[0]), block.apply_translation((0, 0, 30)).export(files[1])
        >>> scenario = apo_bench.import_assembly(files, f"{folder}/clamp.toml", unit="mm")
        >>> [operation.main for operation in scenario.assembly.operations]
        ['block']
    """
    from apo_bench.importers.assembly.choices import AssemblyChoices, check_density
    from apo_bench.importers.assembly.from_cad import import_parts, remove_on_failure
    from apo_bench.importers.assembly.from_poses import scenario_from_poses

    sources = [Path(each) for each in ([files] if isinstance(files, str | Path) else files)]
    require(sources, "no file was given; give a CAD file of several solids, or several files.")
    target = Path(f"{sources[0].stem}.toml") if out is None else Path(out)
    require(target.suffix == ".toml", f"'{target}' was given; use a file name that ends in .toml.")
    require(not target.exists(), f"'{target}' exists already; give another file as `out`.")
    check_density(density)
    choices = AssemblyChoices(
        up, tuple(fixed), tuple(order), clearance_mm, max_overlap_mm, fits, fasteners, density, tuple(skip)
    )
    with remove_on_failure(target.with_name(f"{target.stem}_parts")) as folder:
        made = import_parts(sources, folder, unit, choices)
        names = ", ".join(source.name for source in sources)
        scenario_from_poses(made.poses, (), target, names, choices, made.notes)
    return load_scenario(target)


@check_arguments
def check_scenario(scenario: str | Path | Scenario, *, seeds: int = 5, fidelity: str = "full") -> tuple[str, ...]:
    """Check a scenario from its syntax to trials in which the robot knows the true poses.

    Args:
        scenario: A name, a scenario file, or a scenario that was read from one.
        seeds: Trials that run; 0 runs none.
        fidelity: As in `TrialConfig`.

    Returns:
        The faults, one sentence each; empty if there is none.

    Raises:
        InputError: There is no such file.
    """
    from apo_bench.importers.assembly.scenario_check import check_file

    source = scenario.source if isinstance(scenario, Scenario) else find_scenario_path(scenario)
    require(source is not None, "a scenario was given that was not read from a file; give its file.")
    assert source is not None
    return tuple(str(finding.sentence) for finding in check_file(source, seeds, fidelity) if not finding.ok)
