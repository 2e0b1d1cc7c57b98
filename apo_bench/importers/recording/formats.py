"""Read a log, or a folder of logs, into tracks; what stands in a file is recognised from its content."""

from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from types import MappingProxyType

import numpy as np

from apo_bench.errors import require, require_known
from apo_bench.importers.recording.camera_file import Conventions
from apo_bench.importers.recording.log_columns import LogColumn
from apo_bench.importers.recording.log_json import read_json_tables
from apo_bench.importers.recording.log_poses import orient, read_rows
from apo_bench.importers.recording.log_tables import LogTable, read_text_tables
from apo_bench.importers.recording.tracks import Log, LogRows, sort_rows

_TABLES = ("a table", "columns", "positions", "times", "TUM", "KITTI", "EuRoC", "BOP", "Motive", "Vicon", "ros2")
FORMATS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "auto": (),
        "csv": _TABLES,
        "tum": ("TUM",),
        "kitti": ("KITTI",),
        "euroc": ("EuRoC", "a table"),
        "bop": ("BOP", "JSON"),
        "motive": ("Motive",),
        "vicon": ("Vicon",),
        "plotjuggler": ("a table",),
        "ros-csv": ("ros2", "a table", "columns"),
        "ros-json": ("JSON",),
        "json": ("JSON",),
        "foundationpose": ("a matrix", "matrices"),
        "megapose": ("JSON",),
        "apriltag": ("JSON",),
    }
)
"""Name of a format -> beginnings of what files are recognised as."""
_SUFFIXES = (".csv", ".txt", ".tsv", ".tum", ".dat", ".log", ".json", ".jsonl")  # of logs in a folder
_MATRIX_FOLDER = "ob_in_cam"  # in which FoundationPose writes one matrix for each image
_MOST_IN_IMAGE = 50  # rows of a file for one image
_NO_NAMES = (_MATRIX_FOLDER, "pose", "poses")  # folders that name no object


def read_log(path: str | Path, how: Conventions, form: str = "auto") -> Log:
    """Read a log, or a folder with one log per object or per image.

    Args:
        form: One of `FORMATS`; the log is read as its content demands, and a note says if that is another one.

    Returns:
        Tracks in metres and right-handed axes, camera from model.

    Raises:
        InputError: A file holds no poses that are understood; the message names the line.
    """
    require_known("format", form, FORMATS)
    path = Path(path)
    files = _list_files(path) if path.is_dir() else [path]
    require(files, f"{path}: the folder holds no log; give a folder with one log for each object or image.")
    tables = [table for file in files for table in _read_file(file, how)]
    others = {table.form for table in tables if form != "auto" and not table.form.startswith(FORMATS[form])}
    if len(files) > 1:
        tables = _name_by_folder(tables)
    logs = [read_rows(table, how) for table in tables if table.places]
    require(logs, f"{path}: no pose stands in the log; give a log with one row per pose.")
    poses, more = orient(np.concatenate([log.T for log in logs]), how)
    rows = LogRows(
        ids=[*chain(*(log.ids for log in logs))],
        t=np.concatenate([log.t for log in logs]),
        T=poses,
        lost=np.concatenate([log.lost for log in logs]),
        score=np.concatenate([log.score for log in logs]),
        places=[*chain(*(log.places for log in logs))],
        notes=[
            *dict.fromkeys(chain(*(log.notes for log in logs))),
            *more,
            *([f"not {form}, as stated"] if others else []),
        ],
    )
    return sort_rows(str(path), rows, sum(table.broken for table in tables))


def _list_files(path: Path) -> Sequence[Path]:
    """Return the logs in a folder and its folders: those in folders of matrices alone if there are any."""
    files = [file for file in sorted(path.rglob("*")) if file.is_file() and file.suffix.lower() in _SUFFIXES]
    matrices = [file for file in files if file.parent.resolve().name == _MATRIX_FOLDER]
    return matrices or files


def _read_file(path: Path, how: Conventions) -> list[LogTable]:
    if path.suffix.lower() in (".json", ".jsonl"):
        return read_json_tables(path)
    return read_text_tables(path, how.columns)


def _name_by_folder(tables: Sequence[LogTable]) -> list[LogTable]:
    """Return the tables of a folder with an object and an image for files that are named by an image, or by nothing."""
    numbers = [table.file.stem.rpartition("_")[2] for table in tables]
    by_image = all(map(str.isdigit, numbers)) and all(len(table.places) < _MOST_IN_IMAGE for table in tables)
    repeated = len({table.file.stem for table in tables}) < len({table.file for table in tables})
    named = []
    for table, number in zip(tables, numbers, strict=True):
        folder = table.file.resolve().parent
        folder = folder.parent if folder.name in _NO_NAMES else folder
        has_time = bool(table.cells.keys() & {"t", "sec", "frame"})
        if by_image and not has_time:
            frames = {"frame": [number] * len(table.places)}
            table = table._replace(
                columns={**table.columns, "frame": LogColumn("frame")}, cells={**table.cells, **frames}
            )
        is_image = by_image and (len(table.places) == 1 or not has_time)
        named.append(
            table._replace(name=folder.name) if is_image or (repeated and table.name == table.file.stem) else table
        )
    return named
