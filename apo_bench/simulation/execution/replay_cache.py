"""Cache the states of replays, so that replays with the same beginning share it.

MuJoCo goes on from a state exactly, so a result does not depend on the cache.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from typing import Any, NamedTuple, final

import mujoco
import numpy as np

from apo_bench.assembly import Poses, ReplayResult, Snapshot, Step
from apo_bench.geometry import Array
from apo_bench.simulation.execution.transfer import Transfer
from apo_bench.simulation.robot import Robot
from apo_bench.simulation.scene import wake

_MOST = 4096
"""States, and results, that are kept, 5 kB each; the oldest go first."""
_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


class Progress(NamedTuple):
    """What a replay has reached so far."""

    after: list[Snapshot | None]
    """For each operation, the state when it was done; None while it is not, or when it is undone."""
    timeline: list[tuple[Step, float]]
    """Steps that are done, each with the simulated time of its end, [s]."""


class SavedState(NamedTuple):
    """All that decides how a replay goes on."""

    state: Array
    sensors: Array
    welds: Array
    robot: tuple[Any, ...]
    grip: int
    """Which of the grips of the move is in use."""
    progress: Progress


def save_state(robot: Robot, grip: int, progress: Progress) -> SavedState:
    """The present state; nothing sleeps in it, nor now."""
    model = robot.model
    data = robot.data
    wake(robot.scene.work, data)
    state = np.zeros(mujoco.mj_stateSize(model, _STATE))
    mujoco.mj_getState(model, data, state, _STATE)
    reached = Progress([*progress.after], [*progress.timeline])
    return SavedState(state, data.sensordata.copy(), model.eq_data.copy(), robot.memory(), grip, reached)


def restore_state(saved: SavedState, robot: Robot) -> None:
    """Bring a robot, and all around it, to a state that was saved."""
    robot.model.eq_data[:] = saved.welds
    mujoco.mj_setState(robot.model, robot.data, saved.state, _STATE)
    robot.data.sensordata[:] = saved.sensors
    wake(robot.scene.work, robot.data)
    robot.remember(saved.robot)


@final
class ReplayCache:
    """What the replays of one scene have in common, kept for the trials of one seed; they run in one process."""

    def __init__(self) -> None:
        self._states: dict[bytes, SavedState] = {}
        self._results: dict[bytes, ReplayResult] = {}

    def ended(self, key: bytes) -> ReplayResult | None:
        """The result of a replay that was the same from its beginning to its end."""
        return self._results.get(key)

    def end(self, key: bytes, result: ReplayResult) -> None:
        """Keep the result of a replay under its key."""
        self._results[key] = result
        _drop_oldest(self._results)

    def keep(self, key: bytes, robot: Robot, grip: int, progress: Progress) -> None:
        """Keep the present state under its key; nothing sleeps in it."""
        if key not in self._states:
            self._states[key] = save_state(robot, grip, progress)
            _drop_oldest(self._states)
        else:
            wake(robot.scene.work, robot.data)

    def resume(self, keys: Sequence[bytes], robot: Robot, progress: Progress) -> tuple[int, int]:
        """Take up the furthest state that was kept.

        Returns:
            How many of the keys lead to it, 0 if nothing was kept; and the grip that is in use there.
        """
        for i in range(len(keys), 0, -1):
            saved = self._states.get(keys[i - 1])
            if saved is not None:
                restore_state(saved, robot)
                progress.after[:] = saved.progress.after
                progress.timeline[:] = saved.progress.timeline
                return i, saved.grip
        return 0, 0


def _drop_oldest(kept: dict[bytes, Any]) -> None:
    if len(kept) > _MOST:
        del kept[next(iter(kept))]


def cache_keys(
    scene: Any, start: Poses, fidelity: str, moves: Sequence[tuple[Step, Transfer]], error: Any = None
) -> list[bytes]:
    """A key of the past of each state: two for each move, one when the part is lifted, one when the move is done."""
    digest = hashlib.sha256(
        _bytes((id(scene), sorted(start), [start[part] for part in sorted(start)], fidelity, error))
    )
    keys = []
    for step, t in moves:
        before = digest.copy()
        before.update(_bytes(_until_lifted(t)))
        digest.update(_bytes((step, t)))
        keys += [before.digest(), digest.digest()]
    return keys


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
