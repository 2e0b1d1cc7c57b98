"""The command `apo-bench recording import`: the log of a tracker becomes an observation file."""

from pathlib import Path
from typing import Annotated, Any

import typer

from apo_bench.cli.help import group
from apo_bench.cli.outputs import check_outputs
from apo_bench.cli.printing import print_lines
from apo_bench.cli.values import numbers, path_given, whole_numbers
from apo_bench.errors import InputError, require
from apo_bench.io import write_csv
from apo_bench.scenario.file import load_scenario

recording = group("recording", "Logs of pose trackers.")


@recording.command("import")
def recording_import(
    log: Annotated[Path, typer.Argument(help="The log, or a folder of one file an object.", parser=path_given)],
    form: Annotated[str, typer.Option("--format", help="csv, bop, tum, ros-csv or ros-json.")],
    camera: Annotated[Path, typer.Option(help="How the log is written, and where its camera stands: .toml.")],
    objects: Annotated[Path, typer.Option(help="Which id is which part, and where its frame lies: .toml.")],
    out: Annotated[Path, typer.Option(help="The observation file: .json, or .csv without starts and covariances.")],
    scenario: Annotated[str | None, typer.Option(help="Of which scenario it is; .json needs one.")] = None,
    ends: Annotated[
        str | None, typer.Option(help="When each operation had ended, s with commas, where the log leaves it unclear.")
    ] = None,
    unseen: Annotated[str | None, typer.Option(help="Operations that the log does not show, from 1.")] = None,
    picture: Annotated[Path | None, typer.Option(help="Draw frames, paths and rests into this file: .png.")] = None,
    paths: Annotated[Path | None, typer.Option(help="Write the paths between rests: .csv.")] = None,
) -> None:
    """Turn the log of a pose tracker into an observation: frames, rests, the order of operations."""
    from apo_bench.importers.recording.camera_file import read_camera
    from apo_bench.importers.recording.formats import read_log
    from apo_bench.importers.recording.objects_file import name_tracks, read_objects
    from apo_bench.importers.recording.text import reading_lines

    outputs = [(out, "--out", (".json", ".csv")), (picture, "--picture", (".png",)), (paths, "--paths", (".csv",))]
    check_outputs(outputs, (log, camera, objects))
    require(
        scenario is not None or (out.suffix.lower() != ".json" and not ends and not unseen and not paths),
        "--out .json, --ends, --unseen and --paths need --scenario; give one, or --out FILE.csv alone.",
    )
    stated = read_camera(camera)
    named = read_objects(objects)
    read = read_log(log, form, stated.conventions)
    tracks = name_tracks(read, named)
    print_lines(reading_lines(read, named))
    if scenario is None:
        _import_unplanned(read, stated, tracks, out, picture)
    else:
        _import(read, named, stated, tracks, scenario, (ends, unseen), (out, picture, paths))


def _import(
    log: Any, objects: Any, camera: Any, tracks: Any, scenario: str, order: tuple[str | None, str | None], files: Any
) -> None:
    from apo_bench.importers.recording.drawing import draw_recording
    from apo_bench.importers.recording.importing import import_recording
    from apo_bench.importers.recording.text import PATH_HEAD, imported_lines, path_rows

    out, picture, paths = files
    loaded = load_scenario(scenario)
    stated = _stated(*order, len(loaded.assembly))
    try:
        imported = import_recording(tracks, camera, loaded, stated, log.file, objects.models)
    except InputError:
        if picture is not None:
            draw_recording(f"{log.file}, {loaded.name}; it does not fit", tracks, camera.T_world_camera, [], picture)
            typer.echo(f"Wrote {picture}, as it was read")
        raise
    mains = [operation.main for operation in loaded.assembly.operations]
    rests = [operation.rest for operation in imported.operations]
    if out.suffix.lower() == ".json":
        from apo_bench.formats.json_forms import write_form
        from apo_bench.formats.observation_json import observation_form

        name = scenario if scenario == loaded.name else str(Path(scenario).resolve())
        write_form(observation_form(imported.observation, name), out)
    else:
        _write_table(out, mains, rests, imported.observation.poses, camera)
    if paths is not None:
        write_csv(paths, PATH_HEAD, path_rows(imported))
    found = imported.arrangement.camera
    _show(f"{log.file}, {loaded.name}", tracks, found, mains, rests, picture)
    print_lines(imported_lines(imported))
    _print_written(out, paths, picture)


def _import_unplanned(log: Any, camera: Any, tracks: Any, out: Path, picture: Path | None) -> None:
    from apo_bench.importers.recording.unplanned import unplanned_recording

    recording = unplanned_recording(tracks, camera, log.file)
    parts = [placement.part for placement in recording.placements]
    rests = [placement.rest for placement in recording.placements]
    poses = [recording.camera.T_world_camera @ rest.T for rest in rests]
    _write_table(out, parts, rests, poses, camera)
    _show(log.file, tracks, recording.camera, parts, rests, picture)
    for k, placement in enumerate(recording.placements, start=1):
        if placement.carries:
            typer.echo(f"operation {k}: {placement.part} and {', '.join(placement.carries)} moved together")
    _print_written(out, picture)


def _stated(ends: str | None, unseen: str | None, operations: int) -> Any:
    from apo_bench.importers.recording.ordering import Stated

    hidden = whole_numbers(unseen, "--unseen") if unseen else ()
    require(
        all(1 <= k <= operations for k in hidden),
        f"--unseen {unseen} was given; operations from 1 to {operations} are allowed.",
    )
    require(not ends or not hidden, "--ends and --unseen were given; give one of the two.")
    return Stated(numbers(ends, "--ends") if ends else (), tuple(k - 1 for k in hidden))


def _show(title: str, tracks: Any, camera: Any, parts: list[str], rests: list[Any], picture: Path | None) -> None:
    """Print the camera and where each part rested after its operation, and draw them."""
    from apo_bench.importers.recording.drawing import draw_recording
    from apo_bench.importers.recording.text import camera_lines, rest_lines

    pairs = list(zip(parts, rests, strict=True))
    print_lines(camera_lines(camera))
    typer.echo("\n" + "\n".join(rest_lines(pairs, camera.T_world_camera)) + "\n")
    if picture is not None:
        ended = [(part, rest.begins) for part, rest in pairs if rest is not None]
        draw_recording(title, tracks, camera.T_world_camera, ended, picture)


def _print_written(*paths: Path | None) -> None:
    typer.echo("\n" + "\n".join(f"Wrote {path}" for path in paths if path is not None))


def _write_table(path: Path, parts: list[str], rests: list[Any], poses: Any, camera: Any) -> None:
    """Write observed poses as CSV; an operation that the log does not show has no rest."""
    from apo_bench.importers.recording.text import OBSERVATION_HEAD, observation_rows

    write_csv(path, OBSERVATION_HEAD, observation_rows(parts, poses, rests, camera))
