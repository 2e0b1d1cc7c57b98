"""The card of a data set: `README.md` with fields, episodes and metadata."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, final

from apo_bench import __version__
from apo_bench.geometry import Array
from apo_bench.io import format_count, write_file

FPS = 20
"""Frames, and actions, a second of simulated time."""


class Field(NamedTuple):
    """A row of numbers of every frame."""

    names: tuple[str, ...]
    unit: str
    frame: str
    """In which coordinates."""
    meaning: str
    most: float | tuple[float, ...] = math.inf
    """No number is larger, nor its negative."""


@final
@dataclass(frozen=True, eq=False)
class RecordedEpisode:
    """One episode of T actions."""

    seed: int
    """The number of its trial."""
    task: str
    """In words."""
    observations: Mapping[str, Array]
    """Field -> (T + 1, k), before the first action and after each."""
    actions: Array
    """(T, k)."""
    rewards: Array
    """(T,)."""
    more: Mapping[str, Any]
    """Column of the table of episodes -> what it says of this one; `success` is among them."""


@final
@dataclass(frozen=True, eq=False)
class DatasetMetadata:
    """What is known of all episodes."""

    name: str
    """`replays` or `insertions`."""
    summary: str
    command: str
    """What made them."""
    fields: Mapping[str, Field]
    """Of the observations."""
    action: Field
    episodes: Mapping[str, str]
    """Column of the table of episodes -> what it is."""
    robot: str
    env_spec: str | None = None
    """Of the environment, as Gymnasium writes it."""


LICENCE = "Apache-2.0"


def write_card(
    about: DatasetMetadata, out: Path, counted: tuple[int, int], tables: Mapping[str, Mapping[str, Any]]
) -> None:
    """Write the dataset card `README.md`: every field with its unit and frame, the licence, the command.

    Args:
        counted: How many episodes there are, and how many of them are right.
        tables: Files, as a pattern -> column -> a `Field`, or in words what it is.
    """
    trials = f"{format_count(counted[0], 'simulated trial')}, {counted[1]} right"
    summary = f"{trials}, made by apo_bench {__version__} with MuJoCo"
    lerobot = "LeRobot, " if any(pattern.startswith("meta/") for pattern in tables) else ""
    lines = [
        *("---", "license: apache-2.0", "task_categories: [robotics]", f"tags: [{lerobot}assembly, simulation]"),
        *(f"configs: [{{config_name: {name}, data_files: '{name}'}}]" for name in [*tables][:1] if "parquet" in name),
        "---",
        *("# Assemblies that a robot repeats", "", f"{summary}:", "", f"    {about.command}", "", about.summary, ""),
        f"Nothing was measured on a real robot. `seed` is the number of a trial. There are {FPS} frames in a second of",
        f"simulated time. The robot is `{about.robot}`.",
        *("", f"Licence: {LICENCE}, as that of apo_bench."),
    ]
    for title, columns in tables.items():
        lines += ["", f"## {title}", "", "| column | size | unit | frame | what it is |", "|---|---|---|---|---|"]
        lines += [f"| `{name}` | {' | '.join(_cells(column))} |" for name, column in columns.items()]
        several = {name: c.names for name, c in columns.items() if isinstance(c, Field) and len(c.names) > 1}
        lines += ["", *(f"Numbers of `{name}`: {', '.join(names)}." for name, names in several.items())]
    write_file(out / "README.md", "\n".join(lines) + "\n")


def _cells(column: Field | str) -> tuple[str, ...]:
    if isinstance(column, str):
        return ("", "", "", column)
    return (str(len(column.names) or ""), column.unit, column.frame, column.meaning)
