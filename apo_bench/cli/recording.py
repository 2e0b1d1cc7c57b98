"""The command `apo-bench recording import`: the log of a tracker becomes an observation."""

from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.shared import (
    Command,
    check_output,
    group,
    parse_list,
    path_argument,
    path_option,
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
commands = group("recording", _HELP)


@commands.command("import", cls=Command)
def recording_import(
    log: Annotated[Path, path_argument("LOG", "The log, or a folder with a file for each object.")],
    form: Annotated[str, typer.Option("--format", help="csv, bop, tum, ros-csv or ros-json.")],
    camera: Annotated[Path, path_option("Conventions of the log, and pose of its camera: .toml.")],
    objects: Annotated[Path, path_option("Part and frame of each id: .toml.")],
    out: Annotated[Path, path_option("Write the observation: .json, or .csv without starts and covariances.")],
    scenario: Annotated[str | None, typer.Option(help="Scenario of the recording; .json needs one.")] = None,
    ends: Annotated[
        str | None, typer.Option(help="End of each operation in s, with commas, where the log is ambiguous.")
    ] = None,
    unseen: Annotated[str | None, typer.Option(help="Operations that the log does not show, from 1.")] = None,
    picture: Annotated[Path | None, path_option("Draw frames, paths and rests: .png.")] = None,
    paths: Annotated[Path | None, path_option("Write the paths between rests: .csv.")] = None,
) -> None:
    """Turn the log of a pose tracker into an observation: frames, rests, the order of operations.

    Examples:
      apo-bench recording import log.csv --format csv --camera camera.toml --objects objects.toml --out seen.csv
      apo-bench recording import log.csv --format csv --camera c.toml --objects o.toml --scenario dovetail --out s.json
    """
    from apo_bench.importers.recording.camera_file import read_camera
    from apo_bench.importers.recording.formats import read_log
    from apo_bench.importers.recording.hands import find_hands
    from apo_bench.importers.recording.objects_file import name_tracks, read_objects
    from apo_bench.importers.recording.show.text import reading_lines

    inputs = (log, camera, objects)
    check_output(out, "--out", ".json", ".csv", inputs=inputs)
    check_output(picture, "--picture", ".png", inputs=inputs)
    check_output(paths, "--paths", ".csv", inputs=inputs)
    planned = out.suffix.lower() == ".json" or ends or unseen or paths
    require(scenario is not None or not planned, "--out .json, --ends, --unseen and --paths need --scenario; add it.")
    stated = read_camera(camera)
    named = read_objects(objects)
    read = read_log(log, form, stated.conventions)
    hands = find_hands(read, named)
    tracks = name_tracks(read, named, hands)
    print_columns(reading_lines(read, named, hands))
    if scenario is None:
        _import_alone(read, stated, tracks, out, picture)
    else:
        order = _parse_order(ends, unseen)
        _import_for_scenario(read, named.models, stated, tracks, scenario, order, out, picture, paths)
    print_written(out, paths, picture)


def _import_for_scenario(
    log: Any, models: Any, camera: Any, tracks: Any, scenario: str, order: Any, out: Path, picture: Any, paths: Any
) -> None:
    from apo_bench import load_scenario
    from apo_bench.formats.json_forms import write_form
    from apo_bench.formats.observation_json import observation_form
    from apo_bench.importers.recording.importing import import_recording
    from apo_bench.importers.recording.show.drawing import draw_recording, drawing_of, unfit_drawing
    from apo_bench.importers.recording.show.text import PATH_HEAD, imported_lines, path_rows

    task = load_scenario(scenario)
    require(
        all(0 <= k < len(task.assembly) for k in order.unseen),
        f"--unseen must hold operations from 1 to {len(task.assembly)}.",
    )
    try:
        imported = import_recording(tracks, camera, task, order, log.file, models)
    except InputError:
        if picture is not None:
            draw_recording(unfit_drawing(log, tracks, camera, task), picture)
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
    if picture is not None:
        draw_recording(drawing_of(imported, log, tracks, camera), picture)
    _print_rests(imported.camera, mains, rests, tracks)
    print_columns(imported_lines(imported))


def _import_alone(log: Any, camera: Any, tracks: Any, out: Path, picture: Path | None) -> None:
    from apo_bench.importers.recording.show.drawing import draw_recording, unplanned_drawing
    from apo_bench.importers.recording.show.text import put_lines
    from apo_bench.importers.recording.unplanned import goals_of, unplanned_recording

    recording = unplanned_recording(tracks, camera, log.file)
    parts = [put.part for put in recording.puts]
    rests = [put.rest for put in recording.puts]
    _write_table(out, parts, rests, goals_of(recording), camera)
    if picture is not None:
        draw_recording(unplanned_drawing(recording, log, tracks), picture)
    _print_rests(recording.camera, parts, rests, tracks)
    typer.echo("\n".join(put_lines(recording)))


def _parse_order(ends: str | None, unseen: str | None) -> Any:
    from apo_bench.importers.recording.ordering import Stated

    require(not ends or not unseen, "--ends and --unseen exclude each other; leave one of them out.")
    hidden = parse_list(unseen, "--unseen", int) if unseen else ()
    return Stated(parse_list(ends, "--ends", float) if ends else (), tuple(k - 1 for k in hidden))


def _print_rests(camera: Any, parts: list[str], rests: list[Any], tracks: Any) -> None:
    """Print the camera, and where each part rested after its operation."""
    from apo_bench.importers.recording.show.text import camera_lines, rest_lines

    print_columns(camera_lines(camera))
    times = {part: track.t for part, track in tracks.items()}
    lines = rest_lines(list(zip(parts, rests, strict=True)), camera.T_world_camera, times)
    typer.echo("\n" + "\n".join([*lines, ""]))


def _write_table(path: Path, parts: list[str], rests: list[Any], poses: Any, camera: Any) -> None:
    """Write poses as CSV; an operation that the log does not show has no rest."""
    from apo_bench.importers.recording.importing import deviations
    from apo_bench.importers.recording.show.text import OBSERVATION_HEAD, observation_rows

    sizes = [(1.0, 1.0) if rest is None else deviations(rest, camera) for rest in rests]
    write_csv(path, OBSERVATION_HEAD, observation_rows(parts, poses, sizes, [rest is not None for rest in rests]))
