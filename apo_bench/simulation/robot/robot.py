"""The arm in motion: lines followed with feed-forward, guards, and watching for trouble.

The controller knows what it commanded, its own joint and finger positions and the force on the part in its hand. It
never reads where a part is. It is one class, longer than most: to follow, to feel and to look share every step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np

from apo_bench.assembly.goals import Poses, Step
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.simulation.hooks import TICK_S, Doing, Hooks, hooks_of
from apo_bench.simulation.robot.fast_forward import fast_forward, take_along
from apo_bench.simulation.robot.gripper import gripper_boxes
from apo_bench.simulation.robot.hold_watch import HoldWatch
from apo_bench.simulation.robot.low_pass import WRIST_S, LowPass
from apo_bench.simulation.robot.near import Moving, clear, near_spans
from apo_bench.simulation.robot.opening import fingers_of
from apo_bench.simulation.robot.paths import Trajectory, shifted, smooth, waypoints_unwound
from apo_bench.simulation.robot.reach import along, at_end, within_speed
from apo_bench.simulation.robot.robot_error import RobotError
from apo_bench.simulation.robot.steadying import Carried, steadied
from apo_bench.simulation.scene.scene import Scene
from apo_bench.simulation.scene.world import has_failed, initial_state, part_pose, timestep, unfelt

_COLLISION_N = 20.0
"""An arm that strikes a part it does not hold harder than this has made a protective stop."""
_REST_RAD_S = 2e-3
_REST_M_S = 3e-3
"""Joints and fingers that move slower than this rest."""
_SHIFT_M = 0.001
"""How far the tip is shifted in thought to see how the joints turn."""


class Halt(Exception):
    """The robot gives up; caught by `replay`, which makes an `Outcome` of it."""

    def __init__(self, stage: str, code: str, part: str = "") -> None:
        super().__init__(stage, code, part)
        self.stage = stage
        self.code = code
        self.part = part
        """Which part it is about, if not the one that is moved."""


class Guard(NamedTuple):
    """Stop when the held part is pushed back along `way` by more than `newton`."""

    way: Array
    newton: float


class Robot:
    """One arm during one replay."""

    def __init__(
        self,
        scene: Scene,
        start: Poses,
        watch: Hooks | Callable[[Any], None] | None = None,
        fidelity: str = "full",
        error: RobotError | None = None,
    ) -> None:
        self.scene = scene
        self.hooks = hooks_of(watch)
        self._error = error
        self._off: Array = np.zeros(len(scene.arm.joints)) if error is None else error.joints
        # What is near is looked for where the tip is believed, so with joints that are off nothing is left out.
        self.fidelity = "full" if self._off.any() else fidelity
        self.left_out_s = 0.0
        """How much of the time passed without being simulated."""
        self.model = scene.work.model
        self.arm = scene.arm
        self.stage = "plan"
        self.macro = ""
        self.step: Step | None = None
        self._held: tuple[str, ...] = ()
        self._wrist = LowPass(WRIST_S)
        self.hold_watch = HoldWatch()
        self._carried: Carried | None = None
        self._handled: int | None = None
        self.peak_force_n = 0.0
        self._find_joints()
        self._net = np.zeros((3, self.model.nsensordata))
        self._felt = np.zeros(3)
        self.data: Any = initial_state(scene.work, start)
        self.data.qpos[self._qpos] = self.arm.home + self._off
        self._fingers.put(self.data, self.arm.opening_m)
        self.data.ctrl[:] = 0.0
        mujoco.mj_forward(self.model, self.data)
        self.q: Array = np.array(self.arm.home)
        self.T: Array = scene.kinematics.forward(self.q)
        self._rest = self.T
        self.data.ctrl[self._drives] = self.q + self._off
        self._fingers.command(self.data, self.arm.opening_m)
        self._names = (*scene.work.free, *scene.work.fixed)
        self._forces = self.data.sensordata
        self._on_arm = self._forces.reshape(-1, 3)[len(scene.work.free) :]
        self._on_arm_flat = self._forces[3 * len(scene.work.free) :]

    def follow(self, line: Trajectory, guard: Guard | None = None) -> float:
        """Bring the tip along a line; returns how much of it is left, [m]: not zero if the guard stopped it.

        Raises:
            Halt: The line leaves the arm's reach, or something went wrong on the way.
        """
        if np.abs(line.start - line.end).max() < 1e-7:
            return 0.0
        line = within_speed(self.scene.kinematics, line, self.q, self.arm.limits.speed_rad_s)
        n = max(1, round(line.seconds / self.step_s))
        s = np.concatenate([[0.0], line.progress(np.arange(1, n + 1) / n)])
        done = 0
        for begin, end in self._spans(line, s):
            q = self.q
            if begin > done:
                q = self._reached(at_end(self.scene.kinematics, line, s[done], s[begin], q))
            path = self._reached(along(self.scene.kinematics, line, s[begin : end + 1], q))
            velocity = np.gradient(path, self.step_s, axis=0) if end > begin else np.zeros((1, len(q)))
            if begin > done:
                self._fast_forward(q, velocity[0], begin - done)
            if self._run((path + self._lead * velocity)[1:], guard) < end - begin:
                self._hold_where_it_is()
                return float(np.linalg.norm(line.end[:3, 3] - self.T[:3, 3]))
            self.q = path[-1]
            done = end
        self.T = line.end
        return 0.0

    def trace(self, line: Trajectory) -> Array:
        """Follow a line through free air, and see where the tip really is at each step, (n, 4, 4).

        Raises:
            Halt: The line leaves the arm's reach.
        """
        line = within_speed(self.scene.kinematics, line, self.q, self.arm.limits.speed_rad_s)
        n = max(2, round(line.seconds / self.step_s))
        path = self._reached(along(self.scene.kinematics, line, line.progress(np.arange(n + 1) / n), self.q))
        rows = path + self._lead * np.gradient(path, self.step_s, axis=0)
        found = []
        for row in rows[1:]:
            self.data.ctrl[self._drives] = row + self._off
            mujoco.mj_step(self.model, self.data)
            found.append(self.scene.kinematics.forward(self.data.qpos[self._qpos]))
        self.q = path[-1]
        self.T = line.end
        return np.array(found)

    def pushed(self, force: Array, seconds: float = 0.5) -> Array:
        """Where the tip is, (3,), world, [m], after a force [N] has pushed on it for a while."""
        body = self.model.body(f"arm/{self.arm.mount}").id
        tip = self.scene.kinematics.forward(self.data.qpos[self._qpos])[:3, 3]
        self.data.xfrc_applied[body, :3] = force
        self.data.xfrc_applied[body, 3:] = np.cross(tip - self.data.xipos[body], force)
        self.wait(seconds)
        self.data.xfrc_applied[body] = 0.0
        return np.array(self.scene.kinematics.forward(self.data.qpos[self._qpos])[:3, 3])

    def go(self, end: Array, speed: float, turn_speed: float = 1.5) -> None:
        """Through the air, smoothly, turning by the way on which the wrist does not wind up."""
        for T in waypoints_unwound(self._rest, self.T, end):
            self.follow(smooth(self.T, T, speed, turn_speed))

    def servo(self, law: Callable[[Sequence[float]], Array | None]) -> None:
        """Shift the tip a little, step by step, as the force on the part in the hand has it.

        Args:
            law: Called with the force, (3,) world, [N], before each physics step; returns how far the tip shall be off
                where it began, (3,) world, [m], or None to end.

        Raises:
            Halt: The arm does not reach around there, or something went wrong on the way.
        """
        q = self.q
        T = self.T
        offset = np.zeros(3)
        passed = 0
        moves = np.array([self._across(q, T, axis) for axis in np.eye(3)])
        force = self._net_force()
        ctrl = self.data.ctrl
        drives = self._drives
        while (asked := law(force)) is not None:
            offset = asked
            passed = passed + 1
            ctrl[drives] = q + offset @ moves + self._off
            mujoco.mj_step(self.model, self.data)
            force = self._feel(self.step_s)
            if passed % self._every == 0:
                self._look()
        self.q = q + offset @ moves
        self.T = shifted(T, offset, 1.0)

    def _across(self, q: Array, T: Array, axis: Array) -> Array:
        """How the joints turn while the tip is shifted, (joints,), [rad/m]; as good as exact over some millimetres."""
        inverse = self.scene.kinematics.inverse
        ends = [self._reached(inverse(shifted(T, axis, by), q)) for by in (-_SHIFT_M, _SHIFT_M)]
        return np.asarray((ends[1] - ends[0]) / (2 * _SHIFT_M))

    def wait(self, seconds: float, parts: int = 1) -> None:
        """Stand still; each physics step may be taken in so many parts."""
        self.data.ctrl[self._drives] = self.q + self._off
        steps = round(seconds / self.step_s)
        for done in range(0, steps, self._every):
            n = min(self._every, steps - done)
            with timestep(self.model, self.step_s / parts):
                self._stand_still(parts * n, self.step_s / parts)
            if n == self._every:
                self._look()

    def _stand_still(self, steps: int, step_s: float) -> None:
        """Step without a new command; forces are felt at every step while something is held, else after the last."""
        if self._held:
            for _ in range(steps):
                mujoco.mj_step(self.model, self.data)
                self._feel(step_s)
            return
        with unfelt(self.model):
            mujoco.mj_step(self.model, self.data, steps - 1)
        mujoco.mj_step(self.model, self.data)

    def stand(self, most_s: float = 0.1) -> None:
        """Stand still until the joints and the fingers rest, at most so long, [s]."""
        for _ in range(round(most_s / TICK_S)):
            self.wait(TICK_S)
            if self._rests():
                return

    def fingers(self, to: float) -> None:
        """Command both fingers to an opening [m] until they rest; beyond the part's surface the force limit rules."""
        start = self._nearest_command(to)
        ticks = max(1, round(abs(to - start) / self.arm.limits.fingers_m_s / TICK_S))
        if self.fidelity == "contact" and not self._held and self._may_open(to):
            self._fingers.put(self.data, to)
            return self._pass(ticks * TICK_S)
        for i in range(1, ticks + round(self._fingers.longest_s / TICK_S)):
            self._fingers.command(self.data, start + (to - start) * min(1.0, i / ticks))
            self.wait(TICK_S)
            if self._rests() and (i >= ticks or self._grips_fully()):
                break
        self._fingers.command(self.data, to)

    def _nearest_command(self, to: float) -> float:
        """The command nearest to `to` at which the fingers push as they do now, [m]: their force is limited."""
        command = self._fingers.commanded(self.data)
        slack = self._fingers.slack
        return min(max(command, self.opening() - slack), self.opening() + slack)

    def _grips_fully(self) -> bool:
        """Whether the fingers push with all the force that they have."""
        return abs(self._fingers.commanded(self.data) - self.opening()) >= self._fingers.slack

    def _rests(self) -> bool:
        """Whether the joints and the fingers rest, as far as they feel."""
        turning = np.abs(self.data.qvel[self._dof])
        return bool(turning.max() < _REST_RAD_S and self._fingers.speed(self.data) < _REST_M_S)

    def opening(self) -> float:
        """What the fingers measure, [m] per finger."""
        return self._fingers.opening(self.data)

    def memory(self) -> tuple[Any, ...]:
        """What the controller knows, apart from the physics; for `remember`."""
        felt = (self.peak_force_n, self.left_out_s, self.hold_watch, self._wrist.force)
        return (self.q, self.T, self.stage, self._held, self._handled, *felt)

    def remember(self, memory: tuple[Any, ...]) -> None:
        """Go on from where a `memory` was made, once the physics are where they were then."""
        self.q, self.T, self.stage, held, self._handled, *felt = memory
        self.hold(*held)
        self.peak_force_n, self.left_out_s, self.hold_watch, self._wrist.force = felt

    def load(self) -> float:
        """The weight that the gripper feels, [N]: of the held part and of what really hangs on it."""
        return -float(self._on_arm[:, 2].sum())

    def hold(self, *parts: str) -> None:
        """Say which parts are in the hand: the held one and what it carries, or none."""
        free = self.scene.work.free
        self._held = parts
        self._wrist = LowPass(WRIST_S)
        self._net = np.zeros((3, self.model.nsensordata))
        for i in map(free.index, parts):
            self._net[:, 3 * (len(free) + i) : 3 * (len(free) + i) + 3] += np.eye(3)
            self._net[:, 3 * i : 3 * i + 3] -= np.eye(3)

    def in_hand(self) -> Array:
        """Where the held part lies in the frame of the tip, (4, 4), for `HoldWatch`: nothing is decided by it."""
        tip = pose.inverse(self.scene.kinematics.forward(self.data.qpos[self._qpos]))
        return np.asarray(tip @ part_pose(self.scene.work, self.data, self._held[0]))

    def weld(self, part: str, on: bool) -> None:
        """The ideal gripper: hold the part exactly as it now is, or let go."""
        weld = self.model.equality(f"grasp_{part}").id
        if on:
            body = self.data.body(f"{part}/")
            mount = self.data.body(f"arm/{self.arm.mount}")
            T = pose.inverse(_frame(mount)) @ _frame(body)
            q = np.zeros(4)
            mujoco.mju_mat2Quat(q, np.ascontiguousarray(T[:3, :3]).ravel())
            self.model.eq_data[weld, :11] = (0, 0, 0, *T[:3, 3], *q, 1)
        self.data.eq_active[weld] = int(on)

    def slip(self, operation: int) -> None:
        """What is in the hand moves along the pads, if the robot's errors have it so; nobody is told."""
        if self._error is None or not self._held or not self._error.slips(operation):
            return
        tip = self.scene.kinematics.forward(self.data.qpos[self._qpos])
        after = tip @ self._error.in_hand[operation]
        take_along(self.scene.work, self.data, self._held, (tip, after, after))
        if self.scene.grasp == "weld":
            mujoco.mj_forward(self.model, self.data)
            self.weld(self._held[0], True)

    def steady(self, on: bool) -> None:
        """From now on what is in the hand is carried through the air, or no longer; begin and end at rest."""
        friction = self.scene.grasp == "friction"
        self._carried = Carried(self._held) if on and friction and self._held else None

    def _spans(self, line: Trajectory, s: Array) -> list[tuple[int, int]]:
        """Which steps of a line are simulated: all of them, or those where something is near; at last the end."""
        n = len(s) - 1
        if self.fidelity == "full":
            return [(0, n)]
        spans = near_spans(self.scene, self.data, self._moving(self.opening()), self._held, line, s)
        return spans if spans and spans[-1][1] == n else [*spans, (n, n)]

    def _moving(self, opening: float) -> list[Moving]:
        """The hand and what it holds, as they move with the tip."""
        tip = pose.inverse(self.scene.kinematics.forward(self.data.qpos[self._qpos]))
        held = [Moving(self.scene.pieces[p], tip @ part_pose(self.scene.work, self.data, p)) for p in self._held]
        return [Moving(gripper_boxes(self.scene.kinematics, self.arm, round(opening, 4)), np.eye(4)), *held]

    def _fast_forward(self, q: Array, velocity: Array, steps: int) -> None:
        """Leave out steps on which nothing is near."""
        joints = (self._qpos, self._dof)
        forward = self.scene.kinematics.forward
        fast_forward(self.scene.work, self.data, forward, joints, q - self.q, velocity, self._held)
        self._pass(steps * self.step_s)

    def _may_open(self, to: float) -> bool:
        """Whether nothing is near the empty hand, neither as it is nor with its fingers somewhere else."""
        return clear(self.scene, self.data, self._moving(max(to, self.opening())), (), self.T)

    def _pass(self, seconds: float) -> None:
        """Let time pass in which nothing is felt."""
        self.data.time += seconds
        self._wrist((0.0, 0.0, 0.0), min(seconds, WRIST_S))
        self.left_out_s += seconds

    def _reached(self, q: Array | None) -> Array:
        if q is None:
            raise Halt(self.stage, "unreachable_start" if self.stage in ("pick", "lift") else "unreachable")
        return q

    def _run(self, targets: Array, guard: Guard | None) -> int:
        """Step through joint targets (n, joints), one physics step each; returns how many were run."""
        model = self.model
        data = self.data
        step = mujoco.mj_step
        every = self._every
        rows = np.repeat(data.ctrl[None], len(targets), axis=0)
        rows[:, self._drives] = targets + self._off
        ctrl = data.ctrl
        if guard is None:
            self._run_free(rows)
            return len(targets)
        a, b, c = guard.way.tolist()
        newton = guard.newton
        feel = self._feel
        for i, row in enumerate(rows, start=1):
            ctrl[:] = row
            step(model, data)
            x, y, z = feel(self.step_s)
            if -(x * a + y * b + z * c) > newton:
                self._look()
                return i
            if i % every == 0:
                self._look()
        return len(targets)

    def _run_free(self, rows: Array) -> None:
        """Step through commands (n, controls) that no guard watches: an empty hand feels once a tick, when it looks."""
        model = self.model
        data = self.data
        step = mujoco.mj_step
        ctrl = self.data.ctrl
        for i in range(0, len(rows), self._every):
            tick = rows[i : i + self._every]
            if self._held:
                for row in tick:
                    ctrl[:] = row
                    step(model, data)
                    self._feel(self.step_s)
            else:
                with unfelt(model):
                    for row in tick[:-1]:
                        ctrl[:] = row
                        step(model, data)
                ctrl[:] = tick[-1]
                step(model, data)
            if len(tick) == self._every:
                self._look()

    def _look(self) -> None:
        """Once a tick: stability, contact force on the held part, blows to other parts; then the hook."""
        if has_failed(self.data):
            raise Halt(self.stage, "unstable_simulation")
        if self._carried is not None:
            tip = self.scene.kinematics.forward(self.data.qpos[self._qpos])
            self._carried = steadied(self.scene.work, self.data, tip, self._carried)
        if self._on_arm_flat @ self._on_arm_flat > _COLLISION_N**2:
            struck, force = self._hardest_blow()
            if force > _COLLISION_N:
                raise Halt(self.stage, "collision", struck)
        if self.hooks.after_tick is not None:
            said = self.macro if self.stage == "attach" else self.stage
            k, undoes = self.step or (None, False)
            self.hooks.after_tick(self.data, Doing(k, said, math.hypot(*self._wrist.force), undoes))

    def _feel(self, step_s: float) -> list[float]:
        """The net force in the last step, (3,) world, [N]; the largest that the sensor shows is remembered."""
        force = self._net_force()
        shown = math.hypot(*self._wrist(force, step_s))
        if shown > self.peak_force_n:
            self.peak_force_n = shown
        return force

    def _net_force(self) -> list[float]:
        """The net force of everything but the gripper on what is in the hand, (3,) world, [N].

        What the parts of a group exert on each other cancels.
        """
        net: list[float] = np.dot(self._net, self._forces, self._felt).tolist()
        return net

    def _hardest_blow(self) -> tuple[str, float]:
        """The part that the arm strikes hardest without handling it, and the force, [N]."""
        squares = (self._on_arm * self._on_arm).sum(axis=1)
        if self._handled is not None:
            squares[self._handled] = 0.0
        i = int(squares.argmax())
        return self._names[i], math.sqrt(squares[i])

    def handle(self, part: str | None) -> None:
        """Say which part the fingers may touch."""
        self._handled = None if part is None else self.scene.work.free.index(part)

    def _hold_where_it_is(self) -> None:
        """After a guard: the measured joint positions become the command, which takes the pressure away."""
        self.q = self.data.qpos[self._qpos] - self._off
        self.T = self.scene.kinematics.forward(self.q)
        self.stand(0.06)

    def _find_joints(self) -> None:
        model = self.model
        joints = [model.joint(f"arm/{name}").id for name in self.arm.joints]
        self._qpos = model.jnt_qposadr[joints]
        self._dof = model.jnt_dofadr[joints]
        self.step_s = float(model.opt.timestep)
        self._drives = np.array([model.actuator(f"arm/{name}").id for name in self.arm.joints])
        self._fingers = fingers_of(model, self.arm)
        gain = model.actuator_gainprm[self._drives, 0]
        bias = model.actuator_biasprm[self._drives, 2]
        self._lead = (model.dof_damping[model.jnt_dofadr[joints]] - bias) / gain
        self._every = max(1, round(TICK_S / model.opt.timestep))


def _frame(body: Any) -> Array:
    T = np.eye(4)
    T[:3, :3] = body.xmat.reshape(3, 3)
    T[:3, 3] = body.xpos
    return T
