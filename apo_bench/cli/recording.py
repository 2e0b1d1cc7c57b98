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
  apo-bench recording import log.csv --camera camera.toml --objects objects.toml --out seen.csv
  apo-bench correct stick_in_tower --observation seen.csv
"""
commands = make_group("recording", _HELP)


@commands.command("import", cls=Command)
def recording_import(
    log: Annotated[Path, make_path_argument("LOG", "The log, or a folder with a file for each object.")],
    camera: Annotated[Path, make_path_option("Conventions of the log, and pose of its camera: .toml.")],
    objects: Annotated[Path, make_path_option("Part and frame of each id: .toml.")],
    out: Annotated[Path, make_path_option("Write the observation: .json, or .csv without starts and covariances.")],
    form: Annotated[
        str, typer.Option("--format", help="Expected format, such as csv or tum; the content decides.")
    ] = "auto",
    scenario: Annotated[str | None, typer.Option(help="Scenario of the recording; .json needs one.")] = None,
    operation_ends: Annotated[
        str | None, typer.Option(help="End of each operation in s, with commas, where the log is ambiguous.")
    ] = None,
    unobserved: Annotated[str | None, typer.Option(help="Operations that the log does not show, from 1.")] = None,
    picture: Annotated[Path | None, make_path_option("Draw frames, paths and rests: .png.")] = None,
    paths_out: Annotated[Path | None, make_path_option("Write the paths between rests: .csv.")] = None,
) -> None:
    """Turn the log of a pose tracker into an observation: frames, rests, the order of operations.

    Examples:
      apo-bench recording import log.csv --camera camera.toml --objects objects.toml --out seen.csv
      apo-bench recording import log.csv --camera c.toml --objects o.toml --scenario dovetail --out s.json
    """
    from apo_bench import load_scenario
    from apo_bench.importers.recording.camera_file import read_camera
    from apo_bench.importers.recording.formats import read_log
    from apo_bench.importers.recording.matching import match_tracks
    from apo_bench.importers.recording.objects_file import merge_tags, read_objects

    inputs = (log, camera, objects)
    check_output(out, "--out", ".json", ".csv", inputs=inputs)
    check_output(picture, "--picture", ".png", inputs=inputs)
    check_output(paths_out, "--paths-out", ".csv", inputs=inputs)
    planned = out.suffix.lower() == ".json" or operation_ends or unobserved or paths_out
    require(
        scenario is not None or not planned,
        "--out .json, --operation-ends, --unobserved and --paths-out need --scenario; add it.",
    )
    task = None if scenario is None else load_scenario(scenario)
    solids = {} if task is None else task.assembly.solids
    stated = read_camera(camera)
    named = merge_tags(read_objects(objects), solids)
    read = read_log(log, stated.conventions, form)
    matched = match_tracks(read, named, solids)
    if task is None:
        lines, doubts = _import_alone(read, stated, matched, out, picture)
    else:
        order = _parse_order(operation_ends, unobserved, len(task.assembly))
        files = (out, picture, paths_out)
        lines, doubts = _import_for_scenario(read, named.models, stated, matched, task, scenario, order, files)
    print_columns([*lines, *(("warning", text) for text in (*matched.doubts, *doubts))])
    print_written(out, paths_out, picture)


def _import_for_scenario(
    log: Any, models: Any, camera: Any, matched: Any, task: Any, scenario: Any, order: Any, files: Any
) -> Any:
    """Write the observation, and return lines on what was done and doubts."""
    from apo_bench.formats.json_forms import write_form
    from apo_bench.formats.observation_json import make_observation_form
    from apo_bench.importers.recording.drawing import draw_recording
    from apo_bench.importers.recording.importing import import_recording
    from apo_bench.importers.recording.text import PATH_HEAD, describe_recording, path_rows

    out, picture, paths_out = files
    try:
        imported = import_recording(
            matched.tracks, camera, task, order, log.file, models, matched.identical, matched.offsets
        )
    except InputError:
        if picture is not None:
            draw_recording(
                f"{log.file}, {task.name}; it does not fit", matched.tracks, camera.T_world_camera, [], picture
            )
            typer.echo(f"Wrote {picture}, as the log was read")
        raise
    mains = [operation.main for operation in task.assembly.operations]
    rests = [operation.rest for operation in imported.operations]
    found = imported.arrangement.camera
    if out.suffix.lower() == ".json":
        name = scenario if scenario == task.name else str(Path(scenario).resolve())
        write_form(make_observation_form(imported.observation, name), out)
    else:
        _write_table(out, mains, rests, imported.observation.poses, imported.covariance)
    if paths_out is not None:
        write_csv(paths_out, PATH_HEAD, path_rows(imported))
    placed = list(zip(mains, rests, strict=True))
    _draw(f"{log.file}, {task.name}", imported.tracks, found, placed, picture)
    return describe_recording(log, matched, imported.folded, imported.gross, found, placed), imported.doubts


def _import_alone(log: Any, camera: Any, matched: Any, out: Path, picture: Path | None) -> Any:
    """Write the poses of a recording without a scenario, and return lines on what was done and doubts."""
    from apo_bench.importers.recording.camera_pose import rest_error
    from apo_bench.importers.recording.text import describe_recording
    from apo_bench.importers.recording.unplanned import unplanned_recording

    recording = unplanned_recording(matched.tracks, camera, log.file)
    placed = [(placement.part, placement.rest) for placement in recording.placements]
    poses = [recording.camera.T_world_camera @ rest.T for _, rest in placed]
    covariance = [rest.mean.covariance + rest_error(camera, rest.mean) for _, rest in placed]
    _write_table(out, [part for part, _ in placed], [rest for _, rest in placed], poses, covariance)
    _draw(log.file, matched.tracks, recording.camera, placed, picture)
    together = [
        f"operation {k}: {placement.part} and {', '.join(placement.carries)} moved together"
        for k, placement in enumerate(recording.placements, start=1)
        if placement.carries
    ]
    return describe_recording(log, matched, {}, {}, recording.camera, placed), together


def _parse_order(ends: str | None, unseen: str | None, operations: int) -> Any:
    from apo_bench.importers.recording.ordering import Stated

    require(not ends or not unseen, "--operation-ends and --unobserved exclude each other; leave one of them out.")
    hidden = parse_list(unseen, "--unobserved", int) if unseen else ()
    require(all(1 <= k <= operations for k in hidden), f"--unobserved must hold operations from 1 to {operations}.")
    return Stated(parse_list(ends, "--operation-ends", float) if ends else (), tuple(k - 1 for k in hidden))


def _draw(title: str, tracks: Any, camera: Any, placed: Any, picture: Path | None) -> None:
    """Draw the camera, the tracks, and when each part came to rest after its operation."""
    from apo_bench.importers.recording.drawing import draw_recording

    if picture is not None:
        ended = [(part, rest.begins) for part, rest in placed if rest is not None]
        draw_recording(title, tracks, camera.T_world_camera, ended, picture)


def _write_table(path: Path, parts: list[str], rests: list[Any], poses: Any, covariance: Any) -> None:
    """Write poses as CSV; an operation that the log does not show has no rest."""
    from apo_bench.importers.recording.text import OBSERVATION_HEAD, observation_rows

    write_csv(path, OBSERVATION_HEAD, observation_rows(parts, poses, rests, covariance))
