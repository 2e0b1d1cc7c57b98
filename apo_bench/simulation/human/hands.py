"""Human hands: mocap bodies that hold parts by soft welds, and their motion in simulation."""

from collections.abc import Callable
from copy import copy
from functools import partial
from typing import Any

import mujoco
import numpy as np

from apo_bench.assembly import Poses, Step
from apo_bench.geometry import Array, Ints, all_boxes, pose
from apo_bench.simulation.frames import quaternion
from apo_bench.simulation.hooks import BY_HAND, Hooks, Phase, as_hooks
from apo_bench.simulation.robot import TINY_S, MovingPieces, Trajectory, find_near_spans, take_along
from apo_bench.simulation.scene import HANDS, Scene, allow_sleep, get_part_pose, make_initial_state

_TRAIL_S = 0.019
"""Delay of a held part behind the hand, since the weld, with a time constant of 0.01 s, damps all motion."""
_RUN_UP_S = 0.08
"""Simulation starts this long before a motion comes near anything; an error of 0.3 mm in the delay decays by then."""
_NEAR_M = (0.0001, 0.0003)
"""Distance that counts as near, for a single part and for a group.

A part in a hand sags by 0.05 mm, a group by 0.2 mm.
"""
_REACH_M = 10.0
"""A part farther from the middle of the table is lost."""
_NO_TURN = 1e-9
"""Lines with a smaller rotation do not rotate, [rad]."""
_LOOK_STEPS = 10
"""Number of steps between checks whether everything sleeps."""


class PartLost(Exception):
    """A part is out of reach of any hand, since an unstable simulation has thrown it away."""


class Hands:
    """Two hands and the parts, for one demonstration."""

    def __init__(self, scene: Scene, start: Poses, watch: Hooks | Callable[[Any], None] | None = None) -> None:
        """Put all parts at their start poses; the first tick is called at once."""
        self.scene = scene
        self.world = scene.shown
        self.data: Any = make_initial_state(self.world, start)
        self._step_s = float(self.world.model.opt.timestep)
        self._hooks = as_hooks(watch)
        self._operation: int | None = None
        self._steps = 0  # since the last tick
        self._every = max(1, round(self._hooks.tick_s / self._step_s))  # steps of a tick
        self._tick(self.data)
        self._mocap = [int(self.world.model.body(hand).mocapid[0]) for hand in HANDS]
        self._at = [np.eye(4) for _ in HANDS]  # pose of each hand
        self._held: list[dict[str, Array]] = [{} for _ in HANDS]  # part -> its pose in the hand

    def begin(self, operation: int) -> None:
        """Call the hook before an operation, counted from 0."""
        self._operation = operation
        self._hooks.before_step(Step(operation))

    def end(self, operation: int) -> None:
        """Call the hook after an operation, counted from 0."""
        self._hooks.after_step(Step(operation))

    def pose(self, part: str) -> Array:
        """The world pose of a movable part, (4, 4)."""
        return get_part_pose(self.world, self.data, part)

    def grab(self, hand: int, part: str) -> Array:
        """Hold a part at its present pose, and return that, (4, 4).

        Raises:
            PartLost: The part is not near the table.
        """
        T = self.pose(part)
        if np.abs(T[:3, 3]).max() > _REACH_M:
            raise PartLost(part)
        self._at[hand] = T
        self._put(self.data, hand, T)
        self._hold(hand, part, np.eye(4))
        return T

    def add(self, hand: int, part: str) -> None:
        """Hold one more part, at its present pose relative to the hand."""
        self._hold(hand, part, pose.inverse(self._at[hand]) @ self.pose(part))

    def let_go(self, hand: int, *parts: str) -> None:
        for part in parts:
            self.data.eq_active[self._weld(hand, part)] = 0
            self._held[hand].pop(part, None)

    def move(self, *moves: tuple[int, Trajectory]) -> None:
        """Move hands at the same time; a hand whose line ends early waits at its end.

        While one hand moves alone, stretches far from everything are not simulated.
        """
        counts = [max(1, round(line.seconds / self._step_s)) for _, line in moves]
        n = max(counts)
        hand, line = moves[counts.index(n)]  # the longest motion
        done = 0
        if len(moves) > 1:
            # Simulate until the part in the other hand has come to rest.
            done = min(min(counts) + round(_RUN_UP_S / self._step_s), n)
            self._run(moves, counts, np.arange(1, done + 1))
        for begin, end in self._spans(hand, line, n, done):
            if begin > done:
                self._pass(begin - done, partial(self._fast_forward, hand, line, n, done))
            self._run(((hand, line),), [n], np.arange(begin + 1, end + 1))
            done = end
        for hand, line in moves:
            self._at[hand] = line.end

    def wait(self, seconds: float) -> None:
        """Wait; once everything sleeps, time passes without simulation.

        A part that was just released hangs still at first, so sleep is forbidden during the first steps.
        """
        steps = round(seconds / self._step_s)
        with allow_sleep(self.world, False):
            self._step(min(_LOOK_STEPS, steps))
        for done in range(_LOOK_STEPS, steps, _LOOK_STEPS):
            if self.data.ntree_awake == 0:
                return self._pass(steps - done, lambda data, i: None)
            self._step(min(_LOOK_STEPS, steps - done))

    def _spans(self, hand: int, line: Trajectory, n: int, begun: int) -> list[tuple[int, int]]:
        """The ranges (begin, end) of steps of a line to simulate: those near other parts, and always the end.

        Args:
            n: Number of steps of the line.
            begun: Steps that are done already.
        """
        s = line.progress(_trailing(np.arange(begun, n + 1.0), n, self._step_s))
        held = self._held[hand]
        moving = [MovingPieces(self.scene.pieces[part], T) for part, T in held.items()]
        spans = find_near_spans(self.scene, self.data, moving, tuple(held), line, s, self.world, _RUN_UP_S, _NEAR_M)
        spans = [(begun + begin, begun + end) for begin, end in spans]
        return spans if spans and spans[-1][1] == n else [*spans, (n, n)]

    def _fast_forward(self, hand: int, line: Trajectory, n: int, begin: int, data: Any, steps: int) -> None:
        """Advance a hand and what it holds by `steps` on a line without simulation.

        Args:
            n: Number of steps of the line.
            begin: Steps done before.
            data: The state to change.
        """
        # In steps: at the end and slightly later, for the velocity.
        at = begin + steps + np.array([0.0, TINY_S / self._step_s])
        after, later = line.poses(line.progress(_trailing(at, n, self._step_s)))
        for part, T_hand_part in self._held[hand].items():
            # The pose of a hand without delay that would hold the part where it is.
            before = get_part_pose(self.world, data, part) @ pose.inverse(T_hand_part)
            take_along(self.world, data, (part,), (before, after, later))
        self._put(data, hand, line.poses(line.progress(at[:1] / n))[0])

    def _run(self, moves: tuple[tuple[int, Trajectory], ...], counts: list[int], steps: Ints) -> None:
        """Simulate the given steps, counted from 1, of the lines of hands.

        Args:
            counts: Number of steps of each line; a hand stays at the end of its line.
        """
        targets = []
        for (hand, line), n in zip(moves, counts, strict=True):
            path = line.poses(line.progress(np.minimum(steps / n, 1.0)))
            at = self._mocap[hand]
            targets.append((self.data.mocap_pos[at], path[:, :3, 3]))
            self.data.mocap_quat[at] = quaternion(line.end)
            if np.abs(line.turn).max() > _NO_TURN:
                targets.append((self.data.mocap_quat[at], _quaternions(path)))
        for i in range(len(steps)):
            for now, wanted in targets:
                now[:] = wanted[i]
            self._step(1)

    def _step(self, n: int) -> None:
        """Simulate n steps, and call the hook after every tick."""
        # `left`: steps until the next tick.
        while self._hooks.after_tick is not None and n >= (left := self._every - self._steps):
            mujoco.mj_step(self.world.model, self.data, left)
            self._tick(self.data)
            n = n - left
            self._steps = 0
        if n:
            mujoco.mj_step(self.world.model, self.data, n)
            self._steps += n

    def _pass(self, steps: int, put: Callable[[Any, int], None]) -> None:
        """Let time pass without simulation.

        Args:
            put: (state, steps) changes the present state to that after so many steps; the hook gets copies.
        """
        if self._hooks.after_tick is not None:
            for i in range(self._every - self._steps, steps + 1, self._every):
                picture = copy(self.data)
                self._after(picture, i, put)
                mujoco.mj_kinematics(self.world.model, picture)
                self._tick(picture)
            self._steps = (self._steps + steps) % self._every
        self._after(self.data, steps, put)

    def _tick(self, data: Any) -> None:
        """Call the hook for a tick, with the given state."""
        if self._hooks.after_tick is not None:
            self._hooks.after_tick(data, Phase(self._operation, BY_HAND, 0.0))

    def _after(self, data: Any, steps: int, put: Callable[[Any, int], None]) -> None:
        """Change a state to that after `steps`, with its time."""
        put(data, steps)
        data.time += steps * self._step_s

    def _hold(self, hand: int, part: str, T_hand_part: Array) -> None:
        """Activate the weld of a hand and a part at a relative pose, (4, 4)."""
        weld = self._weld(hand, part)
        # A weld pulls at the frame of a part of boxes, of others at the centre of mass, so that they hang straight.
        solid = self.scene.scenario.assembly.solids[part]
        at = np.zeros(3) if all_boxes(solid.pieces) else solid.centroid
        # MuJoCo's weld: anchor in the part, anchor in the hand, relative rotation, torquescale.
        self.world.model.eq_data[weld, :11] = (
            *at,
            *(T_hand_part[:3, :3] @ at + T_hand_part[:3, 3]),
            *quaternion(T_hand_part),
            1,
        )
        self.data.eq_active[weld] = 1
        self._held[hand][part] = T_hand_part

    def _weld(self, hand: int, part: str) -> int:
        """The id of the weld of a hand and a part."""
        return int(self.world.model.equality(f"{HANDS[hand]}_{part}").id)

    def _put(self, data: Any, hand: int, T: Array) -> None:
        """Set the pose of a hand."""
        data.mocap_pos[self._mocap[hand]] = T[:3, 3]
        data.mocap_quat[self._mocap[hand]] = quaternion(T)


def _trailing(steps: Array, n: int, step_s: float) -> Array:
    """Progress, 0 to 1, of a held part on a line of n steps, which is behind the hand by `_TRAIL_S`."""
    return np.asarray(np.clip((steps - _TRAIL_S / step_s) / n, 0.0, 1.0))


def _quaternions(T: Array) -> Array:
    """Rotations of poses, (k, 4, 4), as quaternions, (k, 4), w first; their signs are arbitrary, as a weld allows."""
    from scipy.spatial.transform import Rotation

    q: Array = Rotation.from_matrix(T[:, :3, :3]).as_quat(scalar_first=True)
    return q
