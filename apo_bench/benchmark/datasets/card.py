"""The card of a data set: a `README.md` with fields, episodes and metadata."""

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from apo_bench import __version__
from apo_bench.geometry import Array
from apo_bench.io import format_count, write_file

FPS = 20
"""Frames, and actions, per second of simulated time."""


class Field(NamedTuple):
    """A vector of numbers that every frame has."""

    names: tuple[str, ...]
    unit: str
    frame: str
    """The coordinate frame of its numbers."""
    meaning: str
    most: float | tuple[float, ...] = math.inf
    """Bound of the absolute value of each number."""


@final
@dataclass(frozen=True, eq=False)
class RecordedEpisode:
    """One episode of T actions."""

    seed: int
    """Seed of its trial."""
    task: str
    """The task in words."""
    observations: Mapping[str, Array]
    """Field -> (T + 1, k): values before the first action and after each."""
    actions: Array
    """(T, k)."""
    rewards: Array
    """(T,)."""
    more: Mapping[str, Any]
    """Column of the table of episodes -> its value for this episode; `success` is among them."""
    robot: Mapping[str, Array] = field(default_factory=dict)
    """Further fields that are no observation -> (T + 1, k), as the observations."""
    images: Mapping[str, NDArray[np.uint8]] = field(default_factory=dict)
    """Camera -> its images before each action, (T, height, width, 3)."""
    truncated: bool = False
    """Whether its time ran out, so that it is truncated and not terminated."""


@final
@dataclass(frozen=True, eq=False)
class DatasetMetadata:
    """Everything that the episodes of a data set have in common."""

    name: str
    """`record_replays` or `record_insertions`."""
    summary: str
    command: str
    """The command line that made them."""
    fields: Mapping[str, Field]
    """Fields of the observations."""
    action: Field
    episodes: Mapping[str, str]
    """Column of the table of episodes -> its meaning."""
    robot: str
    env_spec: str | None = None
    """The environment as JSON, as Gymnasium writes it."""
    robot_fields: Mapping[str, Field] = field(default_factory=dict)
    """Further fields that are no observation."""
    arguments: Mapping[str, Any] = field(default_factory=dict)
    """Argument of the environment -> its value, those with their default included."""


LICENCE = "Apache-2.0"
_CITATION = (
    "@software{apo_bench,",
    "  title   = {apo_bench: does a robot's replay of an observed assembly fit?},",
    "  author  = {{The apo\\_bench authors}},",
    f"  version = {{{__version__}}},",
    f"  license = {{{LICENCE}}}",
    "}",
)


def count_outcomes(episodes: Iterable[Mapping[str, Any]]) -> Counter[str]:
    """Return how many episodes ended with each outcome code, `ok` for a success.

    Args:
        episodes: Their rows of the table of episodes.
    """
    return Counter(str(each.get("code") or each.get("failure_code") or "ok") for each in episodes)


def write_card(
    about: DatasetMetadata, out: Path, outcomes: Counter[str], tables: Mapping[str, Mapping[str, Any]]
) -> None:
    """Write the card `README.md`: every field with its unit and frame, the outcomes, the licence, the command.

    Args:
        outcomes: Outcome code -> number of episodes.
        tables: Pattern of files -> column -> its `Field`, or its meaning in words.
    """
    trials = f"{format_count(outcomes.total(), 'simulated trial')}, {outcomes['ok']} right"
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
        *(
            "",
            "## Splits",
            "",
            "All episodes are the split `train`. Their trials begin at 1000000, so that none is one of",
        ),
        "an evaluation, a track or a sweep, whose numbers are smaller.",
    ]
    lines += ["", "## Outcomes", "", "| code | episodes | share |", "|---|--:|--:|"]
    lines += [f"| `{code}` | {n} | {n / outcomes.total():.0%} |" for code, n in outcomes.most_common()]
    if about.arguments:
        lines += ["", "## Environment", "", "| argument | value |", "|---|---|"]
        lines += [f"| `{name}` | `{value!r}` |" for name, value in about.arguments.items()]
    for title, columns in tables.items():
        lines += ["", f"## {title}", "", "| column | size | unit | frame | what it is |", "|---|---|---|---|---|"]
        lines += [f"| `{name}` | {' | '.join(_list_cells(column))} |" for name, column in columns.items()]
        several = {name: c.names for name, c in columns.items() if isinstance(c, Field) and len(c.names) > 1}
        lines += ["", *(f"Numbers of `{name}`: {', '.join(names)}." for name, names in several.items())]
    lines += ["", "## Citation", "", "```bibtex", *_CITATION, "```"]
    write_file(out / "README.md", "\n".join(lines) + "\n")


def _list_cells(column: Field | str) -> tuple[str, ...]:
    """Return size, unit, frame and meaning of a column; of a column described in words only the meaning."""
    if isinstance(column, str):
        return ("", "", "", column)
    return (str(len(column.names) or ""), column.unit, column.frame, column.meaning)
