"""Write episodes as a LeRobot data set v3.0.

The format is that of `huggingface/lerobot`, `src/lerobot/datasets`. `data` has the frames of all episodes, one row
group per episode. `meta/episodes` describes each episode, with statistics. `meta/tasks.parquet` has the tasks with
their words as the pandas index, and `meta/stats.json` the statistics of all frames. `videos` has the images.

Needs the package pyarrow.
"""

import json
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from apo_bench.benchmark.datasets.card import FPS, DatasetMetadata, Field, RecordedEpisode, count_outcomes, write_card
from apo_bench.benchmark.datasets.episode_videos import VIDEO_PATH, EpisodeVideos
from apo_bench.benchmark.datasets.episodes import KINDS
from apo_bench.benchmark.datasets.lerobot_statistics import compute_statistics
from apo_bench.geometry import Array
from apo_bench.io import replace_file, write_columns, write_file

_PLACE = "chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_CHUNK = 1000
"""Number of files in a folder."""
_FRAMES_OF_A_FILE = 200_000
"""Frames after which a new file begins, some 60 MB."""
_TOGETHER = "observation.environment_state"
"""Name of an observation that joins several: policies of LeRobot use only the state, this and images."""
_OWN = {  # columns of one number
    "next.reward": ("float32", "reward of the action"),
    "next.done": ("bool", "whether the episode is over after the action"),
    "next.success": ("bool", "whether it is over and right, by the judge"),
    "seed": ("int64", "number of the trial"),
    "timestamp": ("float32", "time since the first frame, s"),
    "frame_index": ("int64", "from 0, in the episode"),
    "episode_index": ("int64", "from 0"),
    "index": ("int64", "from 0, over all episodes"),
    "task_index": ("int64", "line of meta/tasks.parquet"),
}
"""Column of one number -> its type and its meaning."""
_OF_EPISODE = {  # column of the table of episodes -> its meaning
    "episode_index": "from 0",
    "tasks": "what is done, in words",
    "length": "how many frames there are",
    "dataset_from_index": "the first `index` of its frames",
    "dataset_to_index": "behind the last",
    "data/chunk_index": "its frames are in data/chunk-CHUNK/file-FILE.parquet",
    "data/file_index": "see there",
    "meta/episodes/chunk_index": "where this line is, in the same way",
    "meta/episodes/file_index": "see there",
}


def write_lerobot(rollouts: Iterable[RecordedEpisode], about: DatasetMetadata, out: Path) -> tuple[int, int]:
    """Write episodes, and the card; a frame is the observation before an action, and the action.

    Returns:
        The number of episodes, and the number of successes.

    Raises:
        OSError: A file cannot be written.
    """
    fields = {_name_observation(name): field for name, field in about.fields.items()} | {"action": about.action}
    # observations to join
    apart = (
        []
        if _TOGETHER in fields
        else [name for name in fields if name not in (_name_observation("agent_pos"), "action")]
    )
    if apart:
        names = tuple(name for each in apart for name in fields[each].names)
        fields[_TOGETHER] = Field(names, "", "", f"{' and '.join(apart)} in one row")
    fields |= {f"robot.{name}": field for name, field in about.robot_fields.items()}
    schema = pa.schema(  # types of the columns
        [(n, pa.float32() if len(f.names) == 1 else pa.list_(pa.float32(), len(f.names))) for n, f in fields.items()]
        + [(name, pa.bool_() if kind == "bool" else getattr(pa, kind)()) for name, (kind, _) in _OWN.items()]
    )
    tasks: dict[str, int] = {}
    episodes: list[dict[str, Any]] = []
    files = frames = 0
    writer: Any = None
    videos = EpisodeVideos(out, _CHUNK)
    with ExitStack() as opened:
        for e, rollout in enumerate(rollouts):
            n = len(rollout.actions)
            if frames >= files * _FRAMES_OF_A_FILE:
                opened.close()
                chunk, file = divmod(files, _CHUNK)
                path = out / "data" / _PLACE.format(chunk_index=chunk, file_index=file)
                path.parent.mkdir(parents=True, exist_ok=True)
                writer = opened.enter_context(parquet.ParquetWriter(opened.enter_context(replace_file(path)), schema))
                files += 1
            columns = _list_columns(rollout, e, frames, tasks.setdefault(rollout.task, len(tasks)))
            if apart:
                columns[_TOGETHER] = np.hstack([columns[name] for name in apart])
            writer.write_table(pa.table([_to_arrow(columns[each.name], each.type) for each in schema], schema=schema))
            of_episode = (e, [rollout.task], n, frames, frames + n, chunk, file, 0, 0)
            statistics = {
                f"stats/{x}/{y}": z for x, column in columns.items() for y, z in compute_statistics(column).items()
            }
            line = dict(zip(_OF_EPISODE, of_episode, strict=True))
            episodes.append({**line, **rollout.more, **statistics, **videos.write(rollout.images, e)})
            frames += n
    if not episodes:
        return 0, 0
    _write_meta(out, about, fields, schema, tasks, episodes, frames, videos)
    outcomes = count_outcomes(episodes)
    of_frames = {**fields, **{name: Field((name,), "", "", meaning) for name, (_, meaning) in _OWN.items()}}
    of_episodes = {**_OF_EPISODE, **about.episodes}
    tables: dict[str, Mapping[str, Any]] = {"data/*/*.parquet": of_frames, "meta/episodes/*/*.parquet": of_episodes}
    if videos.features:
        tables["videos/*/*/*.mp4"] = dict.fromkeys(videos.features, "image of each frame")
    write_card(about, out, outcomes, tables)
    return outcomes.total(), outcomes["ok"]


def _list_columns(rollout: RecordedEpisode, episode: int, before: int, task: int) -> dict[str, Array]:
    """Return the columns of one episode with T frames, (T,) or (T, k).

    Args:
        before: Number of frames of all episodes before.
        task: Number of the task.
    """
    n = len(rollout.actions)
    last = np.arange(n) == n - 1
    # without the observation after the last action
    seen = {_name_observation(name): numbers[:-1] for name, numbers in rollout.observations.items()}
    own = (
        *(rollout.rewards, last, last & bool(rollout.more["success"]), np.full(n, rollout.seed)),
        *(np.arange(n) / FPS, np.arange(n), np.full(n, episode), before + np.arange(n), np.full(n, task)),
    )
    robot = {f"robot.{name}": numbers[:-1] for name, numbers in rollout.robot.items()}
    return {**seen, **robot, "action": rollout.actions, **dict(zip(_OWN, own, strict=True))}


def _name_observation(name: str) -> str:
    """Return the name of an observation in LeRobot."""
    return f"observation.{'state' if name == 'agent_pos' else name}"


def _to_arrow(column: Array, kind: Any) -> Any:
    """Return a column as an Arrow array of this type; vectors become lists of fixed size."""
    if pa.types.is_fixed_size_list(kind):
        return pa.FixedSizeListArray.from_arrays(pa.array(column.ravel().astype(np.float32)), type=kind)
    return pa.array(column.ravel()).cast(kind)


def _write_meta(
    out: Path,
    about: DatasetMetadata,
    fields: Mapping[str, Field],
    schema: Any,
    tasks: Mapping[str, int],
    episodes: list[dict[str, Any]],
    frames: int,
    videos: EpisodeVideos,
) -> None:
    """Write the folder `meta`: episodes, tasks, statistics, and the description `info.json`."""
    folder = out / "meta" / "episodes" / "chunk-000"
    folder.mkdir(parents=True)
    names = [*episodes[0]] if episodes else []
    columns = [[each[name] for each in episodes] for name in names]
    write_columns(names, columns, folder / "file-000.parquet", KINDS)
    _write_tasks(tasks, out / "meta" / "tasks.parquet")
    statistics: dict[str, Any] = videos.summarise()
    for name in schema.names if frames else ():
        column = parquet.read_table(out / "data", columns=[name])[name].combine_chunks()
        numbers = (column.flatten() if name in fields and len(fields[name].names) > 1 else column).to_numpy(False)
        statistics[name] = compute_statistics(numbers.reshape(frames, -1))
    info = {
        "codebase_version": "v3.0",
        "robot_type": about.robot,
        "total_episodes": len(episodes),
        "total_frames": frames,
        "total_tasks": len(tasks),
        "chunks_size": _CHUNK,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": FPS,
        "splits": {"train": f"0:{len(episodes)}"},
        "data_path": f"data/{_PLACE}",
        "video_path": VIDEO_PATH if videos.features else None,
        "features": {
            **{n: {"dtype": "float32", "shape": [len(f.names)], "names": [*f.names]} for n, f in fields.items()},
            **{name: {"dtype": kind, "shape": [1], "names": None} for name, (kind, _) in _OWN.items()},
            **videos.features,
        },
    }
    for name, content in (("info", info), ("stats", statistics)):
        write_file(out / "meta" / f"{name}.json", json.dumps(content, indent=4))


def _write_tasks(tasks: Mapping[str, int], path: Path) -> None:
    """Write tasks so that pandas reads their words as the index."""
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy_kind, "metadata": None}
        for name, kind, numpy_kind in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ]
    told = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "pandas_version": "2.0.0"}
    table = pa.table({"task_index": pa.array([*tasks.values()], pa.int64()), "task": pa.array([*tasks], pa.string())})
    with replace_file(path) as file:
        parquet.write_table(table.replace_schema_metadata({"pandas": json.dumps(told)}), file)
