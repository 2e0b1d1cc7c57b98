"""The arm in motion: lines followed with feed-forward, guards, and watching for trouble.

Every physics step of a replay is taken in `_tick`, where motions come by `_run` (`follow`) or `wait` (`fingers`), or in
`servo_step`, for motions of which each depends on the force in the step before. The robot knows what it commanded,
its joint and finger positions and the force on the part in its hand: no command depends on where a part is. The
simulation alone reads or sets poses of parts: `_look` and `slip` shift them in the hand, `in_hand` records that, and
`follow` and `fingers` leave out steps while nothing is near (fidelity `near-contact`). One class: these share steps.
"""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np

from apo_bench.assembly import Poses, Step
from apo_bench.geometry import Array, pose
from apo_bench.simulation.hooks import TICK_S, Hooks, Phase, as_hooks
from apo_bench.simulation.robot.forces import WRIST_S, ForceSensors, Guard
from apo_bench.simulation.robot.gripper import STUCK_M, fingers_of
from apo_bench.simulation.robot.in_hand import Carried, fast_forward, hold_steady, take_along, weld
from apo_bench.simulation.robot.obstacles import clear, find_near_spans, moving_with_tip
from apo_bench.simulation.robot.paths import Trajectory, distance, smooth_trajectory
from apo_bench.simulation.robot.reach import along, feedforward_command, limit_speed, plan_waypoints, solve_end_angles
from apo_bench.simulation.robot.robot_error import RobotError
from apo_bench.simulation.robot.slip_monitor import GraspSlipMonitor
from apo_bench.simulation.robot.wrist import WristSensor
from apo_bench.simulation.scene import (
    Scene,
    get_part_pose,
    has_failed,
    is_unstable,
    make_initial_state,
    switch_sensors_off,
    use_timestep,
)

_REST_RAD_S = 2e-3  # joints that move slower rest
_REST_M_S = 3e-3  # fingers that move slower rest


class ExecutionAborted(Exception):
    """The robot aborts the execution; `replay` catches it and makes an `Outcome` of it.

    Attributes:
        stage: What the robot did: `pick`, `carry`, `attach` and so on.
        code: What went wrong, a failure code.
        part: Which part it is about, if not the one that is moved.
        why: What is known of the cause.
    """

    def __init__(self, stage: str, code: str, part: str = "") -> None:
        super().__init__(stage, code, part)
        self.stage = stage
        self.code = code
        self.part = part
        self.why = ""


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
        self.arm = scene.arm
        self.model = scene.work.model
        self.hooks = as_hooks(watch)
        self.stage = "plan"
        self.macro = ""
        self.step: Step | None = None
        self.slip_monitor = GraspSlipMonitor()
        self.left_out_s = 0.0
        """How much of the time passed without being simulated."""
        self.wrist: WristSensor | None = None
        """Reads every step and stops guarded motions, while it is on (`by_wrist`)."""
        self._error = error
        self._off: Array = np.zeros(len(scene.arm.joints)) if error is None else error.joints
        # What is near is looked for where the tip is estimated, so with joints that are off nothing is left out.
        self.fidelity = "full" if self._off.any() else fidelity
        self._carried: Carried | None = None
        model = self.model
        joints = [model.joint(f"arm/{name}").id for name in self.arm.joints]
        self._qpos = model.jnt_qposadr[joints]
        self._dof = model.jnt_dofadr[joints]
        self._drives = np.array([model.actuator(f"arm/{name}").id for name in self.arm.joints])
        # A position servo pushes with gain (u - q) - damping dq, so at a constant speed it lags behind its command by
        # damping / gain times the speed: so much is the command ahead of the path; for dry friction by friction / gain.
        damping = model.dof_damping[self._dof] - model.actuator_biasprm[self._drives, 2]
        self._lead = damping / model.actuator_gainprm[self._drives, 0]
        self._stick = model.dof_frictionloss[self._dof] / model.actuator_gainprm[self._drives, 0]
        self.step_s = float(model.opt.timestep)
        self._steps_of_tick = max(1, round(TICK_S / self.step_s))
        self.q: Array = np.array(self.arm.home)
        self.T: Array = scene.kinematics.forward(self.q)
        self._rest = self.T
        self._fingers = fingers_of(model, self.arm)
        self.data: Any = make_initial_state(scene.work, start)
        self.data.qpos[self._qpos] = self.q + self._off
        self._fingers.put(self.data, self.arm.opening_m)
        self.data.ctrl[:] = 0.0
        mujoco.mj_forward(model, self.data)
        self.data.ctrl[self._drives] = self.q + self._off
        self._fingers.command(self.data, self.arm.opening_m)
        self.forces = ForceSensors(scene.work, self.data.sensordata)

    @contextmanager
    def watch_stability(self) -> Iterator[None]:
        """Abort, `unstable_simulation`, where MuJoCo or arithmetic raises an error as the simulation has failed."""
        try:
            yield
        except (mujoco.FatalError, ArithmeticError, ValueError) as error:
            if is_unstable(error, self.data):
                raise ExecutionAborted(self.stage, "unstable_simulation") from error
            raise

    def follow(self, line: Trajectory, guard: Guard | None = None) -> float:
        """Bring the tip along a line; returns how much of it is left, [m]: not zero if the guard stopped it.

        Raises:
            ExecutionAborted: The line leaves the arm's reach, or something went wrong on the way.
        """
        if np.abs(line.start - line.end).max() < 1e-7:
            return 0.0
        kinematics = self.scene.kinematics
        line, knots = limit_speed(kinematics, line, self.q, self.arm.limits.speed_rad_s)
        n = max(1, round(line.seconds / self.step_s))
        s = np.concatenate([[0.0], line.progress(np.arange(1, n + 1) / n)])
        done = 0
        for begin, end in self._spans(line, s):
            q = self.q
            if begin > done:
                q = self.reached(solve_end_angles(kinematics, line, s[done], s[begin], q))
            path = self.reached(along(kinematics, line, s[begin : end + 1], q, knots))
            velocity = np.gradient(path, self.step_s, axis=0) if end > begin else np.zeros((1, len(q)))
            if begin > done:
                joints = (self._qpos, self._dof)
                work = self.scene.work
                fast_forward(work, self.data, kinematics.forward, joints, q - self.q, velocity[0], self.forces.held)
                self._pass((begin - done) * self.step_s)
            if self._run(feedforward_command(path, velocity, self._lead, self._stick)[1:], guard) < end - begin:
                # The measured joint positions become the command, which takes the pressure away.
                self.q = self.encoders()
                self.T = kinematics.forward(self.q)
                self.stand(0.06)
                return distance(self.T, line.end)
            self.q = path[-1]
            done = end
        self.T = line.end
        return 0.0

    def go(self, end: Array, speed: float, turn_speed: float = 1.5) -> None:
        """Through the air, smoothly, turning by the way on which the wrist does not wind up."""
        for T in plan_waypoints(self.scene.kinematics, self.arm, self.T, end, self.q):
            self.follow(smooth_trajectory(self.T, T, speed, turn_speed))

    def servo_step(self, q: Array, passed: int = 1, velocity: Array | None = None) -> list[float]:
        """Take one physics step towards joint angles, [rad], with a velocity, [rad/s], fed forward.

        Args:
            passed: How many steps have passed: after each tick the robot checks its state.

        Returns:
            The force on the part in the hand, (3,) world, [N].
        """
        to = q if velocity is None else feedforward_command(q, velocity, self._lead, self._stick)
        self.data.ctrl[self._drives] = to + self._off
        mujoco.mj_step(self.model, self.data)
        self.forces.take(self.forces.sensors[None], self.step_s)
        if passed % self._steps_of_tick == 0:
            self._look()
        return self.forces.net()

    def wait(self, seconds: float, parts: int = 1) -> None:
        """Stand still; each physics step may be taken in so many parts."""
        command = self._commands(self.q[None])
        steps = round(seconds / self.step_s)
        for done in range(0, steps, self._steps_of_tick):
            n = min(self._steps_of_tick, steps - done)
            with use_timestep(self.model, self.step_s / parts):
                self._tick(np.repeat(command, parts * n, axis=0))
            if n == self._steps_of_tick:
                self._look()

    def stand(self, most_s: float = 0.1) -> None:
        """Stand still until the joints and the fingers rest, at most so long, [s]."""
        for _ in range(round(most_s / TICK_S)):
            self.wait(TICK_S)
            if self._rests():
                return

    def fingers(self, to: float) -> None:
        """Command both fingers to an opening [m] until they rest; beyond the part's surface the force limit rules."""
        fingers = self._fingers
        # Begin at the command nearest to `to` at which the fingers push as they do now: their force is limited.
        opening = self.opening()
        start = min(max(fingers.commanded(self.data), opening - fingers.slack), opening + fingers.slack)
        ticks = max(1, round(abs(to - start) / self.arm.limits.fingers_m_s / TICK_S))
        if self.fidelity == "near-contact" and not self.forces.held:
            # Nothing may be near the empty hand, neither as it is nor with its fingers where they go.
            moving = moving_with_tip(self.scene, self.data, self.tip(), max(to, opening), ())
            if clear(self.scene, self.data, moving, self.T):
                fingers.put(self.data, to)
                return self._pass(ticks * TICK_S)
        for i in range(1, ticks + round(fingers.longest_s / TICK_S)):
            fingers.command(self.data, start + (to - start) * min(1.0, i / ticks))
            self.wait(TICK_S)
            there = i >= ticks or abs(fingers.commanded(self.data) - self.opening()) >= fingers.slack
            if there and self._rests() and max(opening, self.opening()) >= to - STUCK_M:
                break
        fingers.command(self.data, to)

    def _rests(self) -> bool:
        """Whether the joints and the fingers rest, by their encoders."""
        turning = np.abs(self.data.qvel[self._dof])
        return bool(turning.max() < _REST_RAD_S and self._fingers.speed(self.data) < _REST_M_S)

    def opening(self) -> float:
        """What the fingers measure, [m] per finger."""
        return self._fingers.opening(self.data)

    def encoders(self) -> Array:
        """What the joints' encoders say, (joints,), [rad]."""
        return np.asarray(self.data.qpos[self._qpos] - self._off)

    def tip(self) -> Array:
        """Where the tip is, (4, 4), world, by where the joints really are."""
        return self.scene.kinematics.forward(self.data.qpos[self._qpos])

    def memory(self) -> tuple[Any, ...]:
        """What the controller knows, apart from the physics; for `remember`."""
        return self.q, self.T, self.stage, self.left_out_s, self.slip_monitor, self.forces.memory()

    def remember(self, memory: tuple[Any, ...]) -> None:
        """Go on from where a `memory` was made, once the physics are where they were then."""
        self.q, self.T, self.stage, self.left_out_s, self.slip_monitor, forces = memory
        self.forces.remember(forces)

    def in_hand(self) -> Array:
        """The held part in the frame of the tip, (4, 4), for `GraspSlipMonitor`: nothing is decided by it."""
        return np.asarray(pose.inverse(self.tip()) @ get_part_pose(self.scene.work, self.data, self.forces.held[0]))

    def slip(self, operation: int) -> None:
        """What is in the hand moves along the pads, if the robot's errors state it; nothing else knows of it."""
        held = self.forces.held
        if self._error is None or not held or not self._error.slips(operation):
            return
        tip = self.tip()
        after = tip @ self._error.in_hand[operation]
        take_along(self.scene.work, self.data, held, (tip, after, after))
        if self.scene.grasp == "weld":
            mujoco.mj_forward(self.model, self.data)
            weld(self.scene, self.data, held[0], True)

    def compensate(self, off: Array) -> None:
        """From now on the joints are off what is commanded by so much, (joints,), [rad], and no longer by what was."""
        self._off = off
        if off.any():
            self.fidelity = "full"

    def steady(self, on: bool) -> None:
        """From now on what is in the hand is carried through the air, or no longer; begin and end at rest."""
        friction = self.scene.grasp == "friction"
        self._carried = Carried(self.forces.held) if on and friction and self.forces.held else None

    def _spans(self, line: Trajectory, s: Array) -> list[tuple[int, int]]:
        """Which steps of a line are simulated: all of them, or those where something is near; at last the end."""
        n = len(s) - 1
        if self.fidelity == "full":
            return [(0, n)]
        held = self.forces.held
        moving = moving_with_tip(self.scene, self.data, self.tip(), self.opening(), held)
        spans = find_near_spans(self.scene, self.data, moving, held, line, s)
        return spans if spans and spans[-1][1] == n else [*spans, (n, n)]

    def _pass(self, seconds: float) -> None:
        """Let time pass in which no force acts."""
        self.data.time += seconds
        self.forces.wrist((0.0, 0.0, 0.0), min(seconds, WRIST_S))
        self.left_out_s += seconds

    def reached(self, q: Array | None) -> Array:
        """Joint angles, if the arm can be there; else the robot aborts."""
        if q is None:
            raise ExecutionAborted(self.stage, "unreachable_start" if self.stage in ("pick", "lift") else "unreachable")
        return q

    def _commands(self, targets: Array) -> Array:
        """What all drives are commanded, (n, controls), while the joints go to targets, (n, joints), [rad]."""
        commands = np.repeat(self.data.ctrl[None], len(targets), axis=0)
        commands[:, self._drives] = targets + self._off
        return commands

    def _run(self, targets: Array, guard: Guard | None) -> int:
        """Step through joint targets (n, joints), one physics step each; returns how many were run."""
        commands = self._commands(targets)
        for done in range(0, len(commands), self._steps_of_tick):
            tick = commands[done : done + self._steps_of_tick]
            stopped = self._tick(tick, guard)
            if stopped or len(tick) == self._steps_of_tick:
                self._look()
            if stopped:
                return done + stopped
        return len(commands)

    def _tick(self, commands: Array, guard: Guard | None = None) -> int:
        """One physics step for each command, (n, controls), between two looks.

        Forces on what is held are read at each step, and all forces while the sensor at the wrist is on. Sensors of an
        empty hand are read at the look only, so they are computed in the last step only.

        Returns:
            After how many steps the guard stopped it; 0 if it did not.
        """
        model = self.model
        data = self.data
        ctrl = data.ctrl
        if self.wrist is None and not self.forces.held:
            with switch_sensors_off(model):
                for command in commands[:-1]:
                    ctrl[:] = command
                    mujoco.mj_step(model, data)
            ctrl[:] = commands[-1]
            mujoco.mj_step(model, data)
            return 0
        step_s = float(model.opt.timestep)
        sensors = self.forces.sensors
        rows = np.empty((len(commands), len(sensors)))
        push = None if guard is None else self.forces.push(guard)
        newton = math.inf if guard is None else guard.newton
        stopped = False
        steps = 0
        while not stopped and steps < len(commands):
            ctrl[:] = commands[steps]
            mujoco.mj_step(model, data)
            rows[steps] = sensors
            steps += 1
            if self.wrist is not None:
                stopped = self.wrist.take(step_s) and self.wrist.stops(guard)
            elif push is not None:
                stopped = bool(sensors.dot(push) > newton)
        self.forces.take(rows[:steps], step_s)
        return steps if stopped else 0

    def _look(self) -> None:
        """Once a tick: stability, contact force on the held part, blows to other parts; then the hook."""
        if has_failed(self.data):
            raise ExecutionAborted(self.stage, "unstable_simulation")
        if self._carried is not None:
            self._carried = hold_steady(self.scene.work, self.data, self.tip(), self._carried)
        if struck := self.forces.struck():
            raise ExecutionAborted(self.stage, "collision", struck)
        if self.hooks.after_tick is not None:
            macro = self.macro if self.stage == "attach" else self.stage
            k, undoes = self.step or (None, False)
            self.hooks.after_tick(self.data, Phase(k, macro, math.hypot(*self.forces.wrist.force), undoes))
