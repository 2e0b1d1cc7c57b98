"""Cache the states of replays, so that replays with the same first moves simulate these only once.

MuJoCo continues from a saved state exactly, so results do not depend on the cache.
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
"""Greatest number of states, and of results, of 5 kB each; the oldest are dropped first."""
_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)  # everything on which the next step depends


class Progress(NamedTuple):
    """The snapshots and times that a replay has recorded so far."""

    after: list[Snapshot | None]
    """For each operation, the snapshot when it was done; None before, or if it is undone."""
    timeline: list[tuple[Step, float]]
    """The finished steps, each with the simulated time of its end, [s]."""


class SavedState(NamedTuple):
    """The complete state from which a replay continues."""

    state: Array
    """MuJoCo's integration state."""
    sensors: Array
    """`MjData.sensordata`, which the integration state lacks."""
    welds: Array
    """`MjModel.eq_data`, which a weld of the gripper changes."""
    robot: tuple[Any, ...]
    """From `Robot.memory`."""
    grip: int
    """Index of the grip in use among those of the move."""
    progress: Progress


def save_state(robot: Robot, grip: int, progress: Progress) -> SavedState:
    """Return the present state, after waking all sleeping parts.

    Restored states have no sleeping parts either, so both continue in the same way.

    Args:
        grip: Index of the grip in use.
    """
    model = robot.model
    data = robot.data
    wake(robot.scene.work, data)
    state = np.zeros(mujoco.mj_stateSize(model, _STATE))
    mujoco.mj_getState(model, data, state, _STATE)
    reached = Progress([*progress.after], [*progress.timeline])
    return SavedState(state, data.sensordata.copy(), model.eq_data.copy(), robot.memory(), grip, reached)


def restore_state(saved: SavedState, robot: Robot) -> None:
    """Set the physics and the controller of a robot to a saved state."""
    robot.model.eq_data[:] = saved.welds
    mujoco.mj_setState(robot.model, robot.data, saved.state, _STATE)
    robot.data.sensordata[:] = saved.sensors
    wake(robot.scene.work, robot.data)
    robot.remember(saved.robot)


@final
class ReplayCache:
    """Saved states and results of the replays of one scene, for the trials of one seed in one process."""

    def __init__(self) -> None:
        self._states: dict[bytes, SavedState] = {}
        self._results: dict[bytes, ReplayResult] = {}

    def ended(self, key: bytes) -> ReplayResult | None:
        """Return the result of an earlier replay with the same moves, None if there was none."""
        return self._results.get(key)

    def end(self, key: bytes, result: ReplayResult) -> None:
        """Store the result of a finished replay under the key of its last state."""
        self._results[key] = result
        _drop_oldest(self._results)

    def keep(self, key: bytes, robot: Robot, grip: int, progress: Progress) -> None:
        """Store the present state under its key, and wake all parts, as `save_state` does.

        Args:
            grip: Index of the grip in use.
        """
        if key not in self._states:
            self._states[key] = save_state(robot, grip, progress)
            _drop_oldest(self._states)
        else:
            wake(robot.scene.work, robot.data)  # as if saved, so that results do not depend on the cache

    def resume(self, keys: Sequence[bytes], robot: Robot, progress: Progress) -> tuple[int, int]:
        """Restore the furthest stored state of a replay.

        Args:
            keys: Those of all states of the replay, in order.
            progress: Set to the progress of the stored state.

        Returns:
            The number of keys up to this state, 0 if none is stored, and the index of the grip in use.
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
    """Drop the oldest entry if there are more than `_MOST`."""
    if len(kept) > _MOST:
        del kept[next(iter(kept))]


def cache_keys(
    scene: Any, start: Poses, fidelity: str, moves: Sequence[tuple[Step, Transfer]], error: Any = None
) -> list[bytes]:
    """Return two keys for each move: of the state when its part is lifted, and of that when the move is done.

    A key is a digest of everything that influenced the state.

    Args:
        start: True poses of the parts at the beginning.
        error: The errors of the robot.
    """
    digest = hashlib.sha256(
        _bytes((id(scene), sorted(start), [start[part] for part in sorted(start)], fidelity, error))
    )
    keys = []
    for step, t in moves:
        # Until its part is lifted a move depends on fewer fields, so more replays share this state.
        before = digest.copy()
        before.update(_bytes(_until_lifted(t)))
        digest.update(_bytes((step, t)))
        keys += [before.digest(), digest.digest()]
    return keys


def _until_lifted(t: Transfer) -> tuple[Any, ...]:
    """Return the fields of a transfer that influence the state until its part is lifted."""
    grips = t.grips[: 1 if t.out.left is None else 2]
    return (t.part, t.carried, t.T_world_start, grips, t.out, t.departs, t.over, t.safe, t.clearance)


def _bytes(x: Any) -> bytes:
    """Return bytes that are equal for equal content of arrays, dataclasses and sequences."""
    if isinstance(x, np.ndarray):
        return x.tobytes() + b";"
    if is_dataclass(x):
        return _bytes([getattr(x, field.name) for field in fields(x)])
    if isinstance(x, (tuple, list)):
        return b"(" + b"".join(map(_bytes, x)) + b")"
    return repr(x).encode() + b";"
