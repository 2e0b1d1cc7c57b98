"""One episode as learners take it, and what is known of all of a data set."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, final

from apo_bench.geometry import Array

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
class Rollout:
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
class About:
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
