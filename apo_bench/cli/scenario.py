"""The commands `apo-bench scenario list | show | new | check`."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from apo_bench.cli.arguments import NO_RESULT, ScenarioArgument
from apo_bench.cli.help import group
from apo_bench.cli.outputs import check_writable
from apo_bench.cli.values import path_given
from apo_bench.errors import InputError, require
from apo_bench.records import check
from apo_bench.scenario.file import load_scenario, scenario_names


def scenario_list() -> None:
    """List the scenarios that come with the package; generated:SEED names any number of others."""
    from apo_bench.cli.terminal import print_scenarios

    print_scenarios([load_scenario(name) for name in scenario_names()])


scenario = group("scenario", "Scenarios: list, task cards, new ones, checks.", scenario_list)
scenario.command("list")(scenario_list)


@scenario.command("show")
def scenario_show(scenario: ScenarioArgument) -> None:
    """Print the task card of a scenario; the file is checked."""
    from apo_bench.viz.card import scenario_card

    typer.echo(scenario_card(load_scenario(scenario)), nl=False)


@scenario.command("new")
def scenario_new(
    more: Annotated[
        list[str] | None, typer.Argument(metavar="[PART]...", help="Further files, after --parts or --assembly.")
    ] = None,
    *,
    out: Annotated[Path, typer.Option(help="The scenario file to write, .toml.", parser=path_given)],
    poses: Annotated[
        Path | None, typer.Option(help="Where every part is in the end: a file of [[pose]].", parser=path_given)
    ] = None,
    parts: Annotated[
        list[str] | None, typer.Option(help="Part files; default: as named in --poses, beside it.")
    ] = None,
    assembly: Annotated[
        list[str] | None,
        typer.Option(help="A CAD file of several solids, or several in one frame, in place of --parts and --poses."),
    ] = None,
    unit: Annotated[str | None, typer.Option(help="Of --assembly, as in `part import`.")] = None,
    up: Annotated[
        str | None,
        typer.Option(help="Which axis of the poses looks up: x, y, z, -x, -y or -z. Default: z, or what works better."),
    ] = None,
    fixed: Annotated[
        list[str] | None,
        typer.Option(help="A part that is never moved; may be given again. Default: the largest of the lowest."),
    ] = None,
    order: Annotated[
        str | None, typer.Option(help="In which order parts are put, with commas. Default: an order that works.")
    ] = None,
    clearance: Annotated[
        float | None,
        typer.Option(help="Room per side of faces that fit, mm. Default: 0.25."),
    ] = None,
    loosen: Annotated[
        float,
        typer.Option(help="Parts drawn without play, or no deeper in each other, mm, get the clearance; 0: none do."),
    ] = 0.2,
    overwrite: Annotated[bool, typer.Option(help="Make --out and its parts anew where they are.")] = False,
) -> None:
    """Make a scenario of parts at their final poses: contacts, an order, starts, grasps, a comment for each choice."""
    from apo_bench.importers.assembly.from_cad import import_assembly
    from apo_bench.importers.assembly.posed import UPS, read_posed
    from apo_bench.importers.assembly.upright import USUAL_MM, new_upright_scenario
    from apo_bench.importers.assembly.writing import choice_lines, write_scenario

    check_writable(out, "--out", (".toml",))
    require(
        not out.exists() or overwrite,
        f"--out {out} is there already, maybe with changes by hand; name another, or add --overwrite.",
    )
    require(up is None or up in UPS, f"--up {up} was given; {', '.join(UPS)} are allowed.")
    require(0.0 <= (clearance or 0.0) <= 5.0, f"--clearance-mm {clearance} was given; 0 to 5 mm are allowed.")
    require(0.0 <= loosen <= 1.0, f"--loosen {loosen:g} was given; 0 to 1 mm are allowed.")
    named = [*(assembly or parts or []), *(more or [])]
    source = ", ".join(Path(each).name for each in named) if assembly else "" if poses is None else poses.name
    if assembly:
        require(poses is None and not parts, "--assembly was given with --parts or --poses; give one or the other.")
        files, named = [path_given(each) for each in named], []
        poses, lines = import_assembly(files, out.with_name(f"{out.stem}_parts"), unit)
        typer.echo("\n".join([*lines, f"Wrote {poses} and its parts"]))
    elif poses is None:
        raise InputError("neither --assembly nor --poses was given; say where the parts are in the end.")
    asked = [each.strip() for each in order.split(",")] if order else []
    room = USUAL_MM if clearance is None else clearance
    made = new_upright_scenario(read_posed(poses, named), up, fixed or (), room, loosen, asked)
    write_scenario(made, out, f"Assembly of {out.stem}", source)
    typer.echo("\n".join(choice_lines(made)))
    load_scenario(out)
    typer.echo(f"Wrote {out}; look at it with: apo-bench scenario check {shlex.quote(str(out))}")


@scenario.command("check")
def scenario_check(
    file: Annotated[Path, typer.Argument(help="A scenario file.", parser=path_given)],
    seeds: Annotated[int, typer.Option(help="Trials in which the robot knows the truth.")] = 5,
    fidelity: Annotated[str, typer.Option(help="Of these trials: full, or near-contact.")] = "full",
    arm: Annotated[str, typer.Option(help="By which arm, as in `arm check`; what would be in its reach is said.")] = (
        "six_axis"
    ),
) -> None:
    """Say whether human and robot can do a scenario, and which line of its file to change if not."""
    from apo_bench.importers.assembly.checking import check_file

    require(0 <= seeds <= 1000, f"--seeds {seeds} was given; 0 to 1000 are allowed.")
    check("fidelity", fidelity)

    is_well = True
    for finding in check_file(file, seeds, fidelity, arm):
        typer.echo(finding)
        is_well &= finding.ok
    if not is_well:
        raise typer.Exit(NO_RESULT)
