"""Human hands: mocap bodies that hold parts by soft welds and move them along straight lines."""

from __future__ import annotations

from typing import Any, Protocol

import mujoco
import numpy as np

from apo_bench.assembly.goals import Poses
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.simulation.robot.paths import Trajectory
from apo_bench.simulation.scene.scene import HANDS
from apo_bench.simulation.scene.world import World, initial_state, part_pose


class Watcher(Protocol):
    """Looks on: called with the `MjData` at the start and every `period_s` of simulated time, it changes nothing."""

    period_s: float

    def __call__(self, data: Any) -> None: ...


class Hands:
    """Two hands and the parts before them; one demonstration long."""

    def __init__(self, world: World, start: Poses, watch: Watcher | None = None) -> None:
        self.world = world
        self.data: Any = initial_state(world, start)
        self._watch, self._steps = watch, 0
        self._every = max(1, round(watch.period_s / world.model.opt.timestep)) if watch else 0
        if watch:
            watch(self.data)
        self._mocap = [int(world.model.body(hand).mocapid[0]) for hand in HANDS]
        self._at = [np.eye(4) for _ in HANDS]

    def pose(self, part: str) -> Array:
        """Where a movable part is, (4, 4)."""
        return part_pose(self.world, self.data, part)

    def grab(self, hand: int, part: str) -> Array:
        """Take a part where it is, at its frame; returns its pose."""
        T = self.pose(part)
        self._put(hand, T)
        self._hold(hand, part, np.eye(4))
        return T

    def add(self, hand: int, part: str) -> None:
        """Hold one more part, as it lies now beside what the hand holds."""
        self._hold(hand, part, pose.inverse(self._at[hand]) @ self.pose(part))

    def let_go(self, hand: int, *parts: str) -> None:
        for part in parts:
            self.data.eq_active[self._weld(hand, part)] = 0

    def move(self, *moves: tuple[int, Trajectory]) -> None:
        """Move hands together; a hand whose line ends early waits at its end."""
        step = self.world.model.opt.timestep
        counts = [max(1, round(line.seconds / step)) for _, line in moves]
        paths = [line.poses(line.progress(np.arange(1, n + 1) / n)) for (_, line), n in zip(moves, counts, strict=True)]
        targets = [(hand, path[:, :3, 3], _quaternions(path)) for (hand, _), path in zip(moves, paths, strict=True)]
        for i in range(max(counts)):
            for hand, positions, quaternions in targets:
                j = min(i, len(positions) - 1)
                self.data.mocap_pos[self._mocap[hand]] = positions[j]
                self.data.mocap_quat[self._mocap[hand]] = quaternions[j]
            self._step(1)
        for (hand, _), path in zip(moves, paths, strict=True):
            self._at[hand] = path[-1]

    def wait(self, seconds: float) -> None:
        self._step(round(seconds / self.world.model.opt.timestep))

    def _step(self, n: int) -> None:
        """Step, and let who watches look whenever it is time."""
        while self._watch and n >= (left := self._every - self._steps):
            mujoco.mj_step(self.world.model, self.data, left)
            self._watch(self.data)
            n, self._steps = n - left, 0
        if n:
            mujoco.mj_step(self.world.model, self.data, n)
            self._steps += n

    def _hold(self, hand: int, part: str, T_hand_part: Array) -> None:
        weld = self._weld(hand, part)
        quaternion = _quaternions(T_hand_part[None])[0]
        self.world.model.eq_data[weld, :11] = (0, 0, 0, *T_hand_part[:3, 3], *quaternion, 1)
        self.data.eq_active[weld] = 1

    def _weld(self, hand: int, part: str) -> int:
        return int(self.world.model.equality(f"{HANDS[hand]}_{part}").id)

    def _put(self, hand: int, T: Array) -> None:
        self._at[hand] = T
        self.data.mocap_pos[self._mocap[hand]] = T[:3, 3]
        self.data.mocap_quat[self._mocap[hand]] = _quaternions(T[None])[0]


def _quaternions(T: Array) -> Array:
    """(k, 4, 4) -> (k, 4), w first; neighbours may differ in sign, which a weld does not mind."""
    from scipy.spatial.transform import Rotation

    q: Array = Rotation.from_matrix(T[:, :3, :3]).as_quat(scalar_first=True)
    return q
