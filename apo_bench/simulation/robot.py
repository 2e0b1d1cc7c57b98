"""The arm in motion: lines followed with feed-forward, guards, and watching for trouble.

The controller knows what it commanded, its own joint and finger positions and the force on the part in its hand. It
never reads where a part is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import mujoco
import numpy as np
from scipy.interpolate import CubicSpline

from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.program import Poses
from apo_bench.simulation.paths import Line, smooth, unwound
from apo_bench.simulation.scene import Scene
from apo_bench.simulation.world import fresh, unstable

TICK_S = 0.02
"""How often the arm looks for trouble and a film takes a picture."""
KNOT_M, KNOT_RAD = 0.03, 0.15
"""Inverse kinematics is solved this densely along a line; a cubic spline leads through."""
COLLISION_N = 20.0
"""An arm that strikes a part it does not hold harder than this has made a protective stop."""

Watch = Callable[[Any], None]


class Halt(Exception):
    """The robot gives up; caught by `replay`, which makes an `Outcome` of it."""

    def __init__(self, stage: str, code: str, part: str = "") -> None:
        super().__init__(stage, code, part)
        self.stage, self.code = stage, code
        self.part = part
        """Which part it is about, if not the one that is moved."""


class Guard(NamedTuple):
    """Stop when the held part is pushed back along `way` by more than `newton`."""

    way: Array
    newton: float


class Robot:
    """One arm during one replay."""

    def __init__(self, scene: Scene, start: Poses, watch: Watch | None = None) -> None:
        self.scene, self.watch = scene, watch
        self.model, self.arm = scene.work.model, scene.arm
        self.stage = "plan"
        self._held: list[int] = []
        self._handled: int | None = None
        self.peak_force_n = 0.0
        self._find_joints()
        self.data: Any = fresh(scene.work, start)
        self.data.qpos[self._qpos] = self.arm.home
        self.data.qpos[self._fingers] = self.arm.opening_m
        mujoco.mj_forward(self.model, self.data)
        self.q: Array = np.array(self.arm.home)
        self.T: Array = scene.kinematics.forward(self.q)
        self._rest = self.T
        self.data.ctrl[self._drives] = self.q
        self.data.ctrl[self._grip] = self.arm.opening_m
        forces, free = self.data.sensordata.reshape(-1, 3), len(scene.work.free)
        self._on_all, self._on_arm = forces[:free], forces[free:]

    def follow(self, line: Line, guard: Guard | None = None) -> float:
        """Bring the tip along a line; returns how much of it is left, [m]: not zero if the guard stopped it.

        Raises:
            Halt: The line leaves the arm's reach, or something went wrong on the way.
        """
        if np.allclose(line.start, line.end, rtol=0.0, atol=1e-7):
            return 0.0
        step = float(self.model.opt.timestep)
        n = max(1, round(line.seconds / step))
        path = self._joint_path(line)(line.progress(np.arange(1, n + 1) / n))
        velocity = np.gradient(np.vstack([self.q, path]), step, axis=0)[1:]
        done = self._run(path + self._lead * velocity, guard)
        if done < n:
            self._hold_where_it_is()
            return float(np.linalg.norm(line.end[:3, 3] - self.T[:3, 3]))
        self.q, self.T = path[-1], line.end
        return 0.0

    def go(self, end: Array, speed: float, turn_speed: float = 1.5) -> None:
        """Through the air, smoothly, turning by the way on which the wrist does not wind up."""
        for T in unwound(self._rest, self.T, end):
            self.follow(smooth(self.T, T, speed, turn_speed))

    def wait(self, seconds: float) -> None:
        self._run(np.broadcast_to(self.q, (round(seconds / self.model.opt.timestep), len(self.q))), None)

    def fingers(self, to: float, seconds: float = 0.25) -> None:
        """Command both fingers to an opening [m] and wait; beyond the part's surface the force limit rules."""
        start = float(self.data.ctrl[self._grip])
        ticks = max(1, round(seconds / TICK_S))
        for i in range(1, ticks + 1):
            self.data.ctrl[self._grip] = start + (to - start) * min(1.0, i / (0.6 * ticks))
            self.wait(TICK_S)

    def opening(self) -> float:
        """What the fingers measure, [m] per finger."""
        return float(self.data.qpos[self._fingers].min())

    def force(self) -> Array:
        """The net force of everything but the gripper on what is in the hand, (3,) world, [N].

        What the parts of a group exert on each other cancels.
        """
        if not self._held:
            return np.zeros(3)
        return np.asarray((self._on_arm[self._held] - self._on_all[self._held]).sum(axis=0))

    def load(self) -> float:
        """The weight that the gripper feels, [N]: of the held part and of what really hangs on it."""
        return -float(self._on_arm[:, 2].sum())

    def hold(self, *parts: str) -> None:
        """Say which parts are in the hand: the held one and what it carries, or none."""
        self._held = [self.scene.work.free.index(part) for part in parts]

    def weld(self, part: str, on: bool) -> None:
        """The ideal gripper: hold the part exactly as it now is, or let go."""
        weld = self.model.equality(f"grasp_{part}").id
        if on:
            body, mount = self.data.body(f"{part}/"), self.data.body(f"arm/{self.arm.mount}")
            T = pose.inverse(_frame(mount)) @ _frame(body)
            q = np.zeros(4)
            mujoco.mju_mat2Quat(q, np.ascontiguousarray(T[:3, :3]).ravel())
            self.model.eq_data[weld, :11] = (0, 0, 0, *T[:3, 3], *q, 1)
        self.data.eq_active[weld] = int(on)

    def _joint_path(self, line: Line) -> CubicSpline:
        far = np.linalg.norm(line.end[:3, 3] - line.start[:3, 3]) / KNOT_M
        turn = np.linalg.norm(pose.log(pose.inverse(line.start) @ line.end)[3:]) / KNOT_RAD
        s = np.linspace(0.0, 1.0, max(4, int(np.ceil(max(far, turn))) + 1))
        q = [self.q]
        for i, T in enumerate(line.poses(s[1:])):
            guess = 2 * q[-1] - q[-2] if i else q[-1]
            found = self.scene.kinematics.inverse(T, guess)
            if found is None:
                raise Halt(self.stage, "unreachable")
            q.append(found)
        return CubicSpline(s, np.array(q))

    def _run(self, targets: Array, guard: Guard | None) -> int:
        """Step through joint targets (n, joints), one physics step each; returns how many were run."""
        model, data, step, every = self.model, self.data, mujoco.mj_step, self._every
        rows = np.repeat(data.ctrl[None], len(targets), axis=0)
        rows[:, self._drives] = targets
        ctrl = data.ctrl
        for i, row in enumerate(rows, start=1):
            ctrl[:] = row
            step(model, data)
            if guard is not None and self._pushed_back(guard):
                self._look()
                return i
            if i % every == 0:
                self._look()
        return len(targets)

    def _look(self) -> None:
        """Once a tick: stability, contact force on the held part, blows to other parts; the film's picture."""
        if unstable(self.data):
            raise Halt(self.stage, "unstable_simulation")
        self._feel()
        struck, force = self._hardest_blow()
        if force > COLLISION_N:
            raise Halt(self.stage, "collision", struck)
        if self.watch is not None:
            self.watch(self.data)

    def _feel(self) -> Array:
        """The force on the part in the hand, remembered if it is the largest so far."""
        f = self.force()
        self.peak_force_n = max(self.peak_force_n, math.sqrt(f @ f))
        return f

    def _pushed_back(self, guard: Guard) -> bool:
        return bool(-(self._feel() @ guard.way) > guard.newton)

    def _hardest_blow(self) -> tuple[str, float]:
        """The part that the arm strikes hardest without handling it, and the force, [N]."""
        squares = (self._on_arm * self._on_arm).sum(axis=1)
        if self._handled is not None:
            squares[self._handled] = 0.0
        i = int(squares.argmax())
        return (*self.scene.work.free, *self.scene.work.fixed)[i], math.sqrt(squares[i])

    def handle(self, part: str | None) -> None:
        """Say which part the fingers may touch."""
        self._handled = None if part is None else self.scene.work.free.index(part)

    def _hold_where_it_is(self) -> None:
        """After a guard: the measured joint positions become the command, which takes the pressure away."""
        self.q = np.array(self.data.qpos[self._qpos])
        self.T = self.scene.kinematics.forward(self.q)
        self.wait(0.05)

    def _find_joints(self) -> None:
        model = self.model
        joints = [model.joint(f"arm/{name}").id for name in self.arm.joints]
        self._qpos = model.jnt_qposadr[joints]
        self._drives = [model.actuator(f"arm/{name}").id for name in self.arm.joints]
        self._grip = model.actuator(f"arm/{self.arm.grip}").id
        self._fingers = np.array([model.jnt_qposadr[model.joint(f"arm/{name}").id] for name in self.arm.fingers])
        gain, bias = model.actuator_gainprm[self._drives, 0], model.actuator_biasprm[self._drives, 2]
        self._lead = (model.dof_damping[model.jnt_dofadr[joints]] - bias) / gain
        self._every = max(1, round(TICK_S / model.opt.timestep))


def _frame(body: Any) -> Array:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = body.xmat.reshape(3, 3), body.xpos
    return T
