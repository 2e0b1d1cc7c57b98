"""Replays that begin alike share their beginning: the state after each part of a move, kept and taken up again.

MuJoCo goes on from a state exactly, so a result does not depend on what is kept.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Any, NamedTuple, TypeVar, final

import mujoco
import numpy as np

from apo_bench.assembly.goals import Poses, Step
from apo_bench.assembly.reached import ReplayResult, Snapshot
from apo_bench.simulation.execution.transfer import Transfer
from apo_bench.simulation.robot.robot import Robot
from apo_bench.simulation.scene.world import awaken

_MOST = 4096
"""States, and results, that are kept, 5 kB each; the oldest go first."""
_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


_Kept = TypeVar("_Kept")


class SavedState(NamedTuple):
    """All that decides how a replay goes on."""

    state: Any
    felt: Any
    welds: Any
    robot: tuple[Any, ...]
    grip: int
    """Which of the grips of the move is in use."""
    after: tuple[Snapshot | None, ...]
    timeline: tuple[tuple[Step, float], ...]


@final
class ReplayCache:
    """What the replays of one scene have in common, kept for the trials of one seed; they run in one process."""

    def __init__(self) -> None:
        self._kept: dict[bytes, SavedState] = {}
        self._ended: dict[bytes, ReplayResult] = {}

    def ended(self, mark: bytes) -> ReplayResult | None:
        """The result of a replay that was the same from its beginning to its end."""
        return self._ended.get(mark)

    def end(self, mark: bytes, result: ReplayResult) -> None:
        _keep(self._ended, mark, result)

    def keep(
        self,
        mark: bytes,
        robot: Robot,
        grip: int,
        after: Sequence[Snapshot | None],
        timeline: Sequence[tuple[Step, float]],
    ) -> None:
        """Keep the present state under what has led to it; nothing sleeps in it."""
        awaken(robot.scene.work, robot.data)
        if mark not in self._kept:
            model = robot.model
            data = robot.data
            state = np.zeros(mujoco.mj_stateSize(model, _STATE))
            mujoco.mj_getState(model, data, state, _STATE)
            felt = data.sensordata.copy()
            welds = model.eq_data.copy()
            saved = SavedState(state, felt, welds, robot.memory(), grip, tuple(after), tuple(timeline))
            _keep(self._kept, mark, saved)

    def resume(self, marks: Sequence[bytes], robot: Robot) -> tuple[int, SavedState | None]:
        """Take up the furthest state that was kept; returns how many of the marks lie behind it, and what was kept."""
        for i in range(len(marks), 0, -1):
            kept = self._kept.get(marks[i - 1])
            if kept is not None:
                robot.model.eq_data[:] = kept.welds
                mujoco.mj_setState(robot.model, robot.data, kept.state, _STATE)
                robot.data.sensordata[:] = kept.felt
                awaken(robot.scene.work, robot.data)
                robot.remember(kept.robot)
                return i, kept
        return 0, None


def _keep(found: dict[bytes, _Kept], mark: bytes, what: _Kept) -> None:
    found[mark] = what
    if len(found) > _MOST:
        del found[next(iter(found))]


def cache_keys(
    scene: Any, start: Poses, fidelity: str, moves: Sequence[tuple[Step, Transfer]], error: Any = None
) -> list[bytes]:
    """What has led to each state: two marks for each move, one when the part is lifted, one when the move is done."""
    digest = hashlib.sha256(
        _bytes((id(scene), sorted(start), [start[part] for part in sorted(start)], fidelity, error))
    )
    found = []
    for step, t in moves:
        before = digest.copy()
        before.update(_bytes(_until_lifted(t)))
        digest.update(_bytes((step, t)))
        found += [before.digest(), digest.digest()]
    return found


def _until_lifted(t: Transfer) -> tuple[Any, ...]:
    """All of a transfer that matters until its part is lifted."""
    grips = t.grips[: 1 if t.out.left is None else 2]
    return (t.part, t.carried, t.T_world_start, grips, t.out, t.departs, t.over, t.safe, t.clearance)


def _bytes(x: Any) -> bytes:
    """Equal for equal content."""
    if isinstance(x, np.ndarray):
        return x.tobytes() + b";"
    if is_dataclass(x):
        return _bytes([getattr(x, field.name) for field in fields(x)])
    if isinstance(x, (tuple, list)):
        return b"(" + b"".join(map(_bytes, x)) + b")"
    return repr(x).encode() + b";"
