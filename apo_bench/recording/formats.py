"""The formats of logs, and the one that reads them all."""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from apo_bench.errors import InputError, unknown
from apo_bench.files.bop import read_results
from apo_bench.geometry import pose
from apo_bench.recording.camera_file import Conventions
from apo_bench.recording.columns import check_length, oriented
from apo_bench.recording.csv_log import finite_number, read_csv_log, rows_of_files, text_lines
from apo_bench.recording.log import Log, LogRows, checked_log
from apo_bench.recording.ros_log import read_ros_csv, read_ros_json

Reader = Callable[[Path, Conventions], tuple[LogRows, list[str]]]


def read_log(path: str | Path, form: str, how: Conventions) -> Log:
    """A log in one of `FORMATS`, in metres and right-handed axes, camera from model.

    Raises:
        InputError: Anything that is not as described, with the line where it stands.
    """
    if form not in FORMATS:
        raise InputError(unknown("format", form, FORMATS))
    path = Path(path)
    read, endings = FORMATS[form]
    if path.is_dir() and not endings:
        raise InputError(f"{path}: a folder was given; a log of the format {form} is one file.")
    rows, notes = rows_of_files(path, endings, lambda file: read(file, how))
    T, more = oriented(rows.T, how)
    return checked_log(str(path), rows._replace(T=T), [*notes, *more])


def _bop(path: Path, how: Conventions) -> tuple[LogRows, list[str]]:
    """BOP results: mm, rotation matrices, images by number; of several estimates of one object the best score."""
    results = read_results(path)
    scenes = np.unique(results.where[:, 0])
    scene = scenes[0] if how.scene is None and len(scenes) == 1 else how.scene
    if scene is None or scene not in scenes:
        first_few = ", ".join(map(str, scenes[:6].tolist()))
        raise InputError(
            f"{path}: a recording is one scene, and the file holds {first_few}; state `scene` in the camera file."
        )
    if how.rate_hz is None:
        raise InputError(f"{path}: images are numbered and have no time; state `rate_hz` in the camera file.")
    # Rows of the scene by image and object, the best score first; of rows of one image and object the first is kept.
    at = np.flatnonzero(results.where[:, 0] == scene)
    at = at[np.lexsort((-results.score[at], results.where[at, 2], results.where[at, 1]))]
    again = (results.where[at[1:], 1:] == results.where[at[:-1], 1:]).all(axis=1)
    at = at[np.concatenate([[True], ~again])]
    T = np.tile(np.eye(4), (len(at), 1, 1))
    T[:, :3, :3] = pose.nearest_rotations(results.R[at])
    T[:, :3, 3] = results.t_mm[at] * 1e-3
    ids = [str(k) for k in results.where[at, 2]]
    left = f"; {int(again.sum())} estimates of lower score left out" if again.any() else ""
    notes = ["lengths in mm, as in BOP", f"rotation matrices, row by row, at {how.rate_hz:g} images a second{left}"]
    return LogRows(ids, results.where[at, 1] / how.rate_hz, T, [results.spot(int(i)) for i in at]), notes


def _tum(path: Path, how: Conventions) -> tuple[LogRows, list[str]]:
    """`timestamp tx ty tz qx qy qz qw` with spaces between, m; the name of the file is the id."""
    numbers = list[list[float]]()
    places = list[str]()
    for line, words in text_lines(path, separator=None):
        if words[0].startswith("#"):
            continue
        place = f"{path}, line {line}"
        if len(words) != 8:
            raise InputError(f"{place}: timestamp tx ty tz qx qy qz qw are needed, {len(words)} words were given.")
        numbers.append([finite_number(word, place) for word in words])
        places.append(place)
    if not numbers:
        raise InputError(f"{path}: no pose stands in the file; lines of timestamp tx ty tz qx qy qz qw are needed.")
    cells = np.array(numbers)
    check_length(cells[:, 4:], "a quaternion", places)
    T = pose.unpack(np.concatenate([cells[:, 1:4], cells[:, 7:], cells[:, 4:7]], axis=1))
    return LogRows([path.stem] * len(cells), cells[:, 0], T, places), [
        "lengths in m, as in TUM",
        "quaternions x, y, z, w, as in TUM",
    ]


FORMATS: Mapping[str, tuple[Reader, tuple[str, ...]]] = MappingProxyType(
    {
        "csv": (read_csv_log, (".csv",)),
        "bop": (_bop, ()),
        "tum": (_tum, (".txt", ".tum")),
        "ros-csv": (read_ros_csv, (".csv",)),
        "ros-json": (read_ros_json, (".json", ".jsonl")),
    }
)
"""Name -> its reader, and how the files of a folder end that holds one for each object."""
