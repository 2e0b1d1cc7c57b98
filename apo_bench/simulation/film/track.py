"""What was seen of a demonstration or a replay, kept moment by moment: a state and what was done in it."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.assembly.goals import Plan, Poses
from apo_bench.geometry.arrays import Array, frozen
from apo_bench.simulation.hooks import Doing, Hooks
from apo_bench.simulation.scene.world import World

NO_HANDS = frozen(np.zeros((0, 3)), None, 3)


class FilmMoment(NamedTuple):
    """A state of a world, and what is done in it."""

    time_s: float
    qpos: Array
    doing: Doing
    hands: Array
    """Where the hands of the human are, (2, 3), [m]; of a replay (0, 3)."""


@final
@dataclass(frozen=True, eq=False)
class Chapter:
    """A demonstration or a replay from its beginning to its end."""

    title: str
    world: World
    start: Poses
    """Before the first moment; what is fixed stays there."""
    moments: tuple[FilmMoment, ...]
    ending: str
    """What came of it, in a sentence."""
    good: bool | None
    """Whether that is a success; None where nobody asks."""


@final
@dataclass(eq=False)
class FilmTrack:
    """Keeps a demonstration or a replay: pass its `hooks` as `watch`."""

    plan: Plan | None = None
    """What is replayed; None of a demonstration."""
    moments: list[FilmMoment] = field(default_factory=list)

    @property
    def hooks(self) -> Hooks:
        return Hooks(before_replay=self._begin, after_tick=self._keep)

    def _begin(self, plan: Plan) -> None:
        self.plan = plan

    def _keep(self, data: Any, doing: Doing) -> None:
        self.moments.append(FilmMoment(float(data.time), np.array(data.qpos), doing, np.array(data.mocap_pos)))
