"""Read logs of every supported format into tracks."""

from collections.abc import Callable, Mapping
from itertools import chain
from pathlib import Path
from types import MappingProxyType

import numpy as np

from apo_bench.errors import require, require_known
from apo_bench.formats.bop import read_results
from apo_bench.geometry import pose
from apo_bench.importers.recording.camera_file import Conventions
from apo_bench.importers.recording.log_poses import orient, read_rows
from apo_bench.importers.recording.log_tables import LogTable, read_csv_table, read_ros_json_table, read_tum_table
from apo_bench.importers.recording.tracks import Log, LogRows, sort_rows

FORMATS: Mapping[str, Callable[[Path], LogTable] | None] = MappingProxyType(
    {
        "csv": read_csv_table,
        "tum": read_tum_table,
        "ros-csv": read_csv_table,
        "ros-json": read_ros_json_table,
        "bop": None,
    }
)
"""Name of a format -> its reader; None for BOP results, which hold numbers and not cells of text."""


def read_log(path: str | Path, form: str, how: Conventions) -> Log:
    """Read a log, or a folder with one log per object, in one of `FORMATS`.

    Returns:
        Tracks in metres and right-handed axes, camera from model.

    Raises:
        InputError: A file is not as its format demands; the message names the line.
    """
    require_known("format", form, FORMATS)
    path = Path(path)
    files = sorted(file for file in path.iterdir() if file.is_file()) if path.is_dir() else [path]
    require(files, f"{path}: the folder holds no file; give a folder with one log for each object.")
    read = FORMATS[form]
    logs = [_read_bop(file, how) if read is None else read_rows(read(file), how) for file in files]
    ids, t, T, places, notes = zip(*logs, strict=True)
    poses, more = orient(np.concatenate(T), how)
    rows = LogRows([*chain(*ids)], np.concatenate(t), poses, [*chain(*places)], [*notes[0], *more])
    return sort_rows(str(path), rows)


def _read_bop(path: Path, how: Conventions) -> LogRows:
    """Read one scene of BOP results, in mm; of several estimates of an object in an image the best score counts."""
    results = read_results(path)
    scenes = np.unique(results.where[:, 0])
    scene = scenes[0] if how.scene is None and len(scenes) == 1 else how.scene
    require(
        scene in scenes,
        f"{path}: a recording is one scene, and the file holds {', '.join(map(str, scenes[:6].tolist()))}; state "
        "`scene` in the camera file.",
    )
    require(how.rate_hz, f"{path}: images are numbered and have no time; state `rate_hz` in the camera file.")
    # Sorted by image and object, best score first; `unique` then keeps the first row of each pair.
    at = np.flatnonzero(results.where[:, 0] == scene)
    at = at[np.lexsort((-results.score[at], results.where[at, 2], results.where[at, 1]))]
    at = at[np.unique(results.where[at, 1:], axis=0, return_index=True)[1]]
    T = np.tile(np.eye(4), (len(at), 1, 1))
    T[:, :3, :3] = pose.nearest_rotations(results.R[at])
    T[:, :3, 3] = results.t_mm[at] * 1e-3
    t = results.where[at, 1] / (how.rate_hz or 1.0)
    ids = [str(k) for k in results.where[at, 2]]
    notes = ["lengths in mm, as in BOP", f"rotation matrices, row by row, at {how.rate_hz} images a second"]
    return LogRows(ids, t, T, [results.spot(int(i)) for i in at], notes)
