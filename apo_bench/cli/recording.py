"""The command `apo-bench recording import`: the log of a tracker becomes an observation."""

from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.shared import (
    Command,
    check_output,
    make_group,
    make_path_argument,
    make_path_option,
    parse_list,
    print_columns,
    print_written,
)
from apo_bench.errors import InputError, require
from apo_bench.io import write_csv

_HELP = """
Logs of pose trackers.

Examples:
  apo-bench recording import log.csv --format csv --camera camera.toml --objects objects.toml --out seen.csv
  apo-bench correct stick_in_tower --observation seen.csv
"""
commands = make_group("recording", _HELP)


@commands.command("import", cls=Command)
def recording_import(
    log: Annotated[Path, make_path_argument("LOG", "The log, or a folder with a file for each object.")],
    form: Annotated[str, typer.Option("--format", help="csv, bop, tum, ros-csv or ros-json.")],
    camera: Annotated[Path, make_path_option("Conventions of the log, and pose of its camera: .toml.")],
    objects: Annotated[Path, make_path_option("Part and frame of each id: .toml.")],
    out: Annotated[Path, make_path_option("Write the observation: .json, or .csv without starts and covariances.")],
    scenario: Annotated[str | None, typer.Option(help="Scenario of the recording; .json needs one.")] = None,
    operation_ends: Annotated[
        str | None, typer.Option(help="End of each operation in s, with commas, where the log is ambiguous.")
    ] = None,
    unobserved: Annotated[str | None, typer.Option(help="Operations that the log does not show, from 1.")] = None,
    picture: Annotated[Path | None, make_path_option("Draw frames, paths and rests: .png.")] = None,
    paths: Annotated[Path | None, make_path_option("Write the paths between rests: .csv.")] = None,
) -> None:
    """Turn the log of a pose tracker into an observation: frames, rests, the order of operations.

    Examples:
      apo-bench recording import log.csv --format csv --camera camera.toml --objects objects.toml --out seen.csv
      apo-bench recording import log.csv --format csv --camera c.toml --objects o.toml --scenario dovetail --out s.json
    """
    from apo_bench.importers.recording.camera_file import read_camera
    from apo_bench.importers.recording.formats import read_log
    from apo_bench.importers.recording.objects_file import name_tracks, read_objects
    from apo_bench.importers.recording.text import reading_lines

    inputs = (log, camera, objects)
    check_output(out, "--out", ".json", ".csv", inputs=inputs)
    check_output(picture, "--picture", ".png", inputs=inputs)
    check_output(paths, "--paths", ".csv", inputs=inputs)
    planned = out.suffix.lower() == ".json" or operation_ends or unobserved or paths
    require(
        scenario is not None or not planned,
        "--out .json, --operation-ends, --unobserved and --paths need --scenario; add it.",
    )
    stated = read_camera(camera)
    named = read_objects(objects)
    read = read_log(log, form, stated.conventions)
    tracks = name_tracks(read, named)
    print_columns(reading_lines(read, named))
    if scenario is None:
        _import_alone(read, stated, tracks, out, picture)
    else:
        order = _parse_order(operation_ends, unobserved)
        _import_for_scenario(read, named.models, stated, tracks, scenario, order, out, picture, paths)
    print_written(out, paths, picture)


def _import_for_scenario(
    log: Any, models: Any, camera: Any, tracks: Any, scenario: str, order: Any, out: Path, picture: Any, paths: Any
) -> None:
    from apo_bench import load_scenario
    from apo_bench.formats.json_forms import write_form
    from apo_bench.formats.observation_json import observation_form
    from apo_bench.importers.recording.drawing import draw_recording
    from apo_bench.importers.recording.importing import import_recording
    from apo_bench.importers.recording.text import PATH_HEAD, imported_lines, path_rows

    task = load_scenario(scenario)
    require(
        all(0 <= k < len(task.assembly) for k in order.unseen),
        f"--unobserved must hold operations from 1 to {len(task.assembly)}.",
    )
    try:
        imported = import_recording(tracks, camera, task, order, log.file, models)
    except InputError:
        if picture is not None:
            draw_recording(f"{log.file}, {task.name}; it does not fit", tracks, camera.T_world_camera, [], picture)
            typer.echo(f"Wrote {picture}, as the log was read")
        raise
    mains = [operation.main for operation in task.assembly.operations]
    rests = [operation.rest for operation in imported.operations]
    if out.suffix.lower() == ".json":
        name = scenario if scenario == task.name else str(Path(scenario).resolve())
        write_form(observation_form(imported.observation, name), out)
    else:
        _write_table(out, mains, rests, imported.observation.poses, camera)
    if paths is not None:
        write_csv(paths, PATH_HEAD, path_rows(imported))
    _show_rests(f"{log.file}, {task.name}", imported.arrangement.camera, mains, rests, tracks, picture)
    print_columns(imported_lines(imported))


def _import_alone(log: Any, camera: Any, tracks: Any, out: Path, picture: Path | None) -> None:
    from apo_bench.importers.recording.unplanned import unplanned_recording

    recording = unplanned_recording(tracks, camera, log.file)
    parts = [placement.part for placement in recording.placements]
    rests = [placement.rest for placement in recording.placements]
    poses = [recording.camera.T_world_camera @ rest.T for rest in rests]
    _write_table(out, parts, rests, poses, camera)
    _show_rests(log.file, recording.camera, parts, rests, tracks, picture)
    for k, placement in enumerate(recording.placements, start=1):
        if placement.carries:
            typer.echo(f"operation {k}: {placement.part} and {', '.join(placement.carries)} moved together")


def _parse_order(ends: str | None, unseen: str | None) -> Any:
    from apo_bench.importers.recording.ordering import Stated

    require(not ends or not unseen, "--operation-ends and --unobserved exclude each other; leave one of them out.")
    hidden = parse_list(unseen, "--unobserved", int) if unseen else ()
    return Stated(parse_list(ends, "--operation-ends", float) if ends else (), tuple(k - 1 for k in hidden))


def _show_rests(title: str, camera: Any, parts: list[str], rests: list[Any], tracks: Any, picture: Path | None) -> None:
    """Print and draw the camera, and where each part rested after its operation."""
    from apo_bench.importers.recording.drawing import draw_recording
    from apo_bench.importers.recording.text import camera_lines, rest_lines

    pairs = list(zip(parts, rests, strict=True))
    print_columns(camera_lines(camera))
    typer.echo("\n" + "\n".join([*rest_lines(pairs, camera.T_world_camera), ""]))
    if picture is not None:
        ended = [(part, rest.begins) for part, rest in pairs if rest is not None]
        draw_recording(title, tracks, camera.T_world_camera, ended, picture)


def _write_table(path: Path, parts: list[str], rests: list[Any], poses: Any, camera: Any) -> None:
    """Write poses as CSV; an operation that the log does not show has no rest."""
    from apo_bench.importers.recording.text import OBSERVATION_HEAD, observation_rows

    write_csv(path, OBSERVATION_HEAD, observation_rows(parts, poses, rests, camera))
