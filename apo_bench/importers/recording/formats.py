"""The formats of logs, and the one that reads them all."""

from collections.abc import Callable, Mapping
from itertools import chain
from pathlib import Path
from types import MappingProxyType

import numpy as np

from apo_bench.errors import require, require_known
from apo_bench.formats.bop import read_results
from apo_bench.geometry import pose
from apo_bench.importers.recording.camera_file import Conventions
from apo_bench.importers.recording.columns import orient
from apo_bench.importers.recording.ros_messages import read_ros_json
from apo_bench.importers.recording.row_logs import read_csv_log, read_ros_csv, read_tum
from apo_bench.importers.recording.tracks import Log, LogRows, sort_rows

Reader = Callable[[Path, Conventions], LogRows]


def read_log(path: str | Path, form: str, how: Conventions) -> Log:
    """A log in one of `FORMATS`, in metres and right-handed axes, camera from model.

    Raises:
        InputError: Anything that is not as described, with the line where it stands.
    """
    require_known("format", form, FORMATS)
    path = Path(path)
    read, endings = FORMATS[form]
    require(not path.is_dir() or endings, f"{path}: a folder was given; a log of the format {form} is one file.")
    # Of a folder each file is one object.
    files = sorted(file for ending in endings for file in path.glob(f"*{ending}")) if path.is_dir() else [path]
    require(
        files,
        f"{path}: the folder itself holds no file that ends in {' or '.join(endings)}; give a folder with one file for "
        "each object.",
    )
    ids, t, T, places, notes = zip(*(read(file, how) for file in files), strict=True)
    poses, more = orient(np.concatenate(T), how)
    rows = LogRows([*chain(*ids)], np.concatenate(t), poses, [*chain(*places)], [*notes[0], *more])
    return sort_rows(str(path), rows)


def _read_bop(path: Path, how: Conventions) -> LogRows:
    """BOP results: mm, rotation matrices, images by number; of several estimates of one object the best score."""
    results = read_results(path)
    scenes = np.unique(results.where[:, 0])
    scene = scenes[0] if how.scene is None and len(scenes) == 1 else how.scene
    require(
        scene is not None and scene in scenes,
        f"{path}: a recording is one scene, and the file holds {', '.join(map(str, scenes[:6].tolist()))}; state "
        "`scene` in the camera file.",
    )
    require(
        how.rate_hz is not None, f"{path}: images are numbered and have no time; state `rate_hz` in the camera file."
    )
    # Rows of the scene by image and object, the best score first; of rows of one image and object the first is kept.
    at = np.flatnonzero(results.where[:, 0] == scene)
    at = at[np.lexsort((-results.score[at], results.where[at, 2], results.where[at, 1]))]
    again = (results.where[at[1:], 1:] == results.where[at[:-1], 1:]).all(axis=1)
    at = at[np.concatenate([[True], ~again])]
    T = np.tile(np.eye(4), (len(at), 1, 1))
    T[:, :3, :3] = pose.nearest_rotations(results.R[at])
    T[:, :3, 3] = results.t_mm[at] * 1e-3
    left = f"; {int(again.sum())} estimates of lower score left out" if again.any() else ""
    return LogRows(
        ids=[str(k) for k in results.where[at, 2]],
        t=results.where[at, 1] / how.rate_hz,
        T=T,
        places=[results.spot(int(i)) for i in at],
        notes=["lengths in mm, as in BOP", f"rotation matrices, row by row, at {how.rate_hz:g} images a second{left}"],
    )


FORMATS: Mapping[str, tuple[Reader, tuple[str, ...]]] = MappingProxyType(
    {
        "csv": (read_csv_log, (".csv",)),
        "bop": (_read_bop, ()),
        "tum": (read_tum, (".txt", ".tum")),
        "ros-csv": (read_ros_csv, (".csv",)),
        "ros-json": (read_ros_json, (".json", ".jsonl")),
    }
)
"""Name -> its reader, and how the files of a folder end that holds one for each object."""
