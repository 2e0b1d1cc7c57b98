"""The controller of the arm: it follows lines with feedforward, stops at guards, and aborts on failures.

Every physics step of a replay is taken in one of two methods. `_tick` takes those of `follow`, `wait` and `fingers`;
`servo_step` takes those of motions that depend on the force after each step.

The robot knows its commands, its joint and finger positions and the force on the held part; no command depends on the
true pose of a part. Only the simulation reads or sets these: `check_state` and `slip` shift parts in the hand,
`in_hand` records this, and `follow` and `fingers` skip steps while nothing is near (fidelity `near-contact`).

The file is long because all these methods change one state: the command, the simulation and its time.
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
from apo_bench.simulation.robot.obstacles import RUN_UP_S, clear, find_near_spans, moving_with_tip
from apo_bench.simulation.robot.paths import Trajectory, distance, smooth_trajectory
from apo_bench.simulation.robot.reach import along, feedforward_command, limit_speed, plan_waypoints, solve_end_angles
from apo_bench.simulation.robot.robot_error import RobotError
from apo_bench.simulation.robot.slip_monitor import GraspSlipMonitor
from apo_bench.simulation.robot.wrist import WristSensor
from apo_bench.simulation.scene import (
    Scene,
    compute_only,
    get_part_pose,
    has_failed,
    is_unstable,
    make_initial_state,
    use_timestep,
)

_REST_RAD_S = 2e-3  # joint speed below which the arm is at rest
_REST_M_S = 3e-3  # finger speed below which the fingers are at rest
_LAG_M = 1e-4
"""Distance of the resting tip from its command above which `level` corrects it; a compensated arm with a part in its
hand is within 0.02 mm."""
_PUSHED_N = 0.5  # external force above which contact may hold the arm off its command
_LEVEL_S = 0.2  # duration of this correction
_SWING_S = 0.25
"""Time simulated before held parts may touch something on a guarded motion: until then they swing in the hand."""
_GENTLY = 0.3
"""Share of their speed at which fingers close on a part: both pads meet it at once, and would tilt it at full speed."""
_SAG_STEPS = 25  # physics steps between two poses for which the sag of the joints is computed


class ExecutionAborted(Exception):
    """The robot aborts the execution; `replay` catches it and makes an `Outcome` of it.

    Attributes:
        stage: What the robot did: `pick`, `carry`, `attach` and so on.
        code: What went wrong, a failure code.
        part: The part concerned; empty if it is the moved one.
        why: A phrase about the likely cause; empty if it is unknown.
    """

    def __init__(self, stage: str, code: str, part: str = "") -> None:
        super().__init__(stage, code, part)
        self.stage = stage
        self.code = code
        self.part = part
        self.why = ""


class Robot:
    """The controller of one arm during one replay, with the simulation that it moves in."""

    def __init__(
        self,
        scene: Scene,
        start: Poses,
        watch: Hooks | Callable[[Any], None] | None = None,
        fidelity: str = "full",
        error: RobotError | None = None,
    ) -> None:
        """Put the arm at home, its fingers open, and the parts at their true start poses.

        Args:
            start: Pose of each part, (4, 4), world.
            watch: Hooks, or a function called with the `MjData` at each tick.
            fidelity: `full` or `near-contact`.
            error: The errors of the robot, which its controller does not know.
        """
        self.scene = scene
        self.arm = scene.arm
        self.model = scene.work.model
        self.hooks = as_hooks(watch)
        # The action in progress, for outcomes and hooks.
        self.stage = "plan"
        self.macro = ""
        self.step: Step | None = None
        self.slip_monitor = GraspSlipMonitor()
        self.felt = False
        """Whether the last motion with a guard ended on contact."""
        self.left_out_s = 0.0
        """Time skipped without simulation so far, [s]."""
        self.wrist: WristSensor | None = None
        """The sensor that reads every step and stops guarded motions; None while it is off (`read_wrist`)."""
        self._error = error
        # True minus measured joint angles.
        self._off: Array = np.zeros(len(scene.arm.joints)) if error is None else error.joints
        # Compliance of the joints behind the encoders, [rad/(N m)].
        self._sag: Array = np.zeros(1) if error is None else error.sag
        # Commands less measured joint angles at rest, for which the commands compensate.
        self._droop: Array = np.zeros(len(scene.arm.joints))
        # The search for near parts uses the estimated tip, so with joint errors no step is skipped.
        self.fidelity = "full" if self._off.any() or self._sag.any() else fidelity
        self._carried: Carried | None = None
        model = self.model
        joints = [model.joint(f"arm/{name}").id for name in self.arm.joints]
        self._qpos = model.jnt_qposadr[joints]
        self._dof = model.jnt_dofadr[joints]
        self._drives = np.array([model.actuator(f"arm/{name}").id for name in self.arm.joints])
        # A position servo pushes with gain (u - q) - damping dq. At constant speed it lags behind its command by
        # damping / gain times the speed, and by friction / gain for dry friction. The command leads the path by both.
        damping = model.dof_damping[self._dof] - model.actuator_biasprm[self._drives, 2]
        self._lead = damping / model.actuator_gainprm[self._drives, 0]
        self._stick = model.dof_frictionloss[self._dof] / model.actuator_gainprm[self._drives, 0]
        self._sticks = bool(self._stick.any())
        self._sags = bool(self._sag.any())
        self.step_s = float(model.opt.timestep)
        self.steps_of_tick = max(1, round(TICK_S / self.step_s))
        """Number of physics steps after which the state is checked."""
        # Commanded joint angles, and the tip pose to which they lead without errors.
        self.q: Array = np.array(self.arm.home)
        self.T: Array = scene.kinematics.forward(self.q)
        self._fingers = fingers_of(model, self.arm)
        self.data: Any = make_initial_state(scene.work, start)
        self.data.qpos[self._qpos] = self._true(self.q[None])[0]
        self._fingers.put(self.data, self.arm.opening_m)
        self._controls: Array = self.data.ctrl  # a view, since the attribute takes a microsecond
        self.data.ctrl[:] = 0.0
        mujoco.mj_forward(model, self.data)
        self.data.ctrl[self._drives] = self._true(self.q[None])[0]
        self._fingers.command(self.data, self.arm.opening_m)
        self.forces = ForceSensors(scene.work, self.data.sensordata)

    @contextmanager
    def watch_stability(self) -> Iterator[None]:
        """Within this context, abort with `unstable_simulation` if a diverged simulation raises an error."""
        try:
            yield
        except (mujoco.FatalError, ArithmeticError, ValueError) as error:
            if is_unstable(error, self.data):
                raise ExecutionAborted(self.stage, "unstable_simulation") from error
            raise

    def follow(self, line: Trajectory, guard: Guard | None = None) -> float:
        """Move the tip along a line; return how much of it is left, [m]: 0 unless the guard stopped the motion.

        Args:
            line: From the present commanded pose `T`.
            guard: Force limit at which the arm stops; None: no limit.

        Raises:
            ExecutionAborted: The line leaves the arm's reach, or something went wrong on the way.
        """
        if np.abs(line.start - line.end).max() < 1e-7:  # nothing to do
            return 0.0
        kinematics = self.scene.kinematics
        self.felt = self.felt and guard is None
        line, knots = limit_speed(kinematics, line, self.q, self.arm.limits.speed_rad_s)
        # Progress along the line after each of n physics steps.
        n = max(1, round(line.seconds / self.step_s))
        s = np.concatenate([[0.0], line.progress(np.arange(1, n + 1) / n)])
        done = 0
        swings = guard is not None and bool(self.forces.held)
        for begin, end in self._spans(line, s, _SWING_S if swings else RUN_UP_S):
            q = self.q
            if begin > done:  # nothing is near before this stretch: skip to its begin
                q = self.reached(solve_end_angles(kinematics, line, s[done], s[begin], q))
            path = self.reached(along(kinematics, line, s[begin : end + 1], q, knots))
            velocity = np.gradient(path, self.step_s, axis=0) if end > begin else np.zeros((1, len(q)))
            if begin > done:
                joints = (self._qpos, self._dof)
                work = self.scene.work
                fast_forward(work, self.data, kinematics.forward, joints, q - self.q, velocity[0], self.forces.held)
                self._pass((begin - done) * self.step_s)
            if self._run(feedforward_command(path, velocity, self._lead, self._stick)[1:], guard) < end - begin:
                self.felt = True
                # The guard stopped it: the measured joint angles become the command, which takes the pressure away.
                self.q = self.encoders()
                self.T = kinematics.forward(self.q)
                self.stand(0.06)
                return distance(self.T, line.end)
            self.q = path[-1]
            done = end
        self.T = line.end
        return 0.0

    def go(self, end: Array, speed: float, turn_speed: float = 1.5) -> None:
        """Move the tip smoothly through the air to a pose, by waypoints on which the wrist does not wind up.

        Args:
            end: Pose of the tip, (4, 4).
            speed, turn_speed: Peak speeds, [m/s] and [rad/s].
        """
        for T in plan_waypoints(self.scene.kinematics, self.arm, self.T, end, self.q):
            self.follow(smooth_trajectory(self.T, T, speed, turn_speed))

    def servo_step(self, q: Array, passed: int = 1, velocity: Array | None = None) -> list[float]:
        """Take one physics step with commanded joint angles.

        Args:
            q: Joint angles, (joints,), [rad].
            passed: Number of this step, from 1; the robot checks its state after each full tick.
            velocity: Joint velocities for the feedforward, (joints,), [rad/s]; None: no feedforward.

        Returns:
            The contact force on the held part, (3,), world, [N].
        """
        self.command(q, velocity)
        mujoco.mj_step(self.model, self.data)
        force = self.forces.take_step(self.step_s)
        if passed % self.steps_of_tick == 0:
            self.check_state()
        return force

    def command(self, q: Array, velocity: Array | None = None) -> None:
        """Command joint angles to the servos; arguments as for `servo_step`."""
        to = q
        if velocity is not None and self._sticks:
            to = feedforward_command(q, velocity, self._lead, self._stick)
        elif velocity is not None:
            to = q + self._lead * velocity
        self._controls[self._drives] = (self._true(to[None])[0] if self._sags else to + self._off) + self._droop

    def wait(self, seconds: float, parts: int = 1) -> None:
        """Stand still for some time.

        Args:
            parts: Number of shorter steps into which each physics step is divided.
        """
        self.data.ctrl[:] = self._commands(self.q[None])[0]
        steps = round(seconds / self.step_s)
        for done in range(0, steps, self.steps_of_tick):
            n = min(self.steps_of_tick, steps - done)
            with use_timestep(self.model, self.step_s / parts):
                self._tick(parts * n)
            if n == self.steps_of_tick:
                self.check_state()

    def stand(self, most_s: float = 0.1) -> None:
        """Stand still until the joints and the fingers rest, or for `most_s`."""
        for _ in range(round(most_s / TICK_S)):
            self.wait(TICK_S)
            if self._rests():
                return

    def fingers(self, to: float) -> None:
        """Move both fingers to an opening, [m], and wait until they rest; a part between them limits the motion.

        The command moves at the speed limit of the fingers, more slowly where they close on a part. If it lies inside a
        part, the fingers press with at most their force limit.
        """
        fingers = self._fingers
        # Begin at the command nearest to `to` at which the fingers push as they do now: their force is limited.
        opening = self.opening()
        start = min(max(fingers.commanded(self.data), opening - fingers.slack), opening + fingers.slack)
        speed = self.arm.limits.fingers_m_s * (_GENTLY if to < opening and self.forces.held else 1.0)
        ticks = max(1, round(abs(to - start) / speed / TICK_S))
        if self.fidelity == "near-contact" and not self.forces.held:
            # Nothing may be near the empty hand, neither as it is nor with its fingers where they go.
            moving = moving_with_tip(self.scene, self.data, self.tip(), max(to, opening), ())
            if clear(self.scene, self.data, moving, self.T):
                fingers.put(self.data, to)
                return self._pass(ticks * TICK_S)
        for i in range(1, ticks + round(fingers.longest_s / TICK_S)):
            fingers.command(self.data, start + (to - start) * min(1.0, i / ticks))
            self.wait(TICK_S)
            # The command has arrived, or leads so far that the fingers push with all their force.
            there = i >= ticks or abs(fingers.commanded(self.data) - self.opening()) >= fingers.slack
            if there and self._rests() and max(opening, self.opening()) >= to - STUCK_M:
                break
        fingers.command(self.data, to)

    def level(self) -> None:
        """Raise the resting arm to its command if its encoders show that it hangs lower, unless it touches something.

        Servos yield to a weight that is not compensated. From now on the commands include the difference, so that after
        a guarded stop, too, the arm carries its weight instead of resting it on what it touches.
        """
        lag = self.q - self.encoders()
        off = self.scene.kinematics.forward(self.q - lag)[:3, 3] - self.T[:3, 3]
        hangs = self._droop.any() or np.linalg.norm(off) > _LAG_M
        if not hangs or self.forces.external_n() > _PUSHED_N:
            return
        steps = round(_LEVEL_S / self.step_s)
        self._run(self.q + np.linspace(0.0, 1.0, steps)[:, None] * lag, None)
        self._droop = self._droop + lag
        self.stand()

    def _rests(self) -> bool:
        """Whether the joints and the fingers are at rest."""
        turning = np.abs(self.data.qvel[self._dof])
        return bool(turning.max() < _REST_RAD_S and self._fingers.speed(self.data) < _REST_M_S)

    def ft_drift(self) -> Array:
        """Return how far the force-torque sensor has drifted by now, (6,) or (1,) if it does not, [N] and [Nm]."""
        return np.zeros(1) if self._error is None else self._error.ft_drift * self.data.time

    def opening(self) -> float:
        """Return the measured opening of each finger, [m]."""
        return self._fingers.opening(self.data)

    def encoders(self) -> Array:
        """Return the measured joint angles, (joints,), [rad]; they contain the joint errors."""
        measured = self.data.qpos[self._qpos] - self._off
        if self._sag.any():
            measured = measured + self._sag * self.scene.kinematics.gravity_torque(measured)
        return np.asarray(measured)

    def tip(self) -> Array:
        """Return the pose of the tip by the true joint angles, (4, 4), world."""
        return self.scene.kinematics.forward(self.data.qpos[self._qpos])

    def memory(self) -> tuple[Any, ...]:
        """Return the state of the controller, without that of the physics, for `remember`."""
        return self.q, self.T, self._droop, self.stage, self.left_out_s, self.slip_monitor, self.forces.memory()

    def remember(self, memory: tuple[Any, ...]) -> None:
        """Restore the state that `memory` returned; the caller restores that of the physics."""
        self.q, self.T, self._droop, self.stage, self.left_out_s, self.slip_monitor, forces = memory
        self.forces.remember(forces)

    def in_hand(self) -> Array:
        """Return the true pose of the held part in the frame of the tip, (4, 4), for `GraspSlipMonitor` only."""
        return np.asarray(pose.inverse(self.tip()) @ get_part_pose(self.scene.work, self.data, self.forces.held[0]))

    def slip(self, operation: int) -> None:
        """Shift the held parts in the hand by the slip that was drawn for an operation, unknown to the controller."""
        held = self.forces.held
        if self._error is None or not held or not self._error.slips(operation):
            return
        tip = self.tip()
        after = tip @ self._error.in_hand[operation]
        take_along(self.scene.work, self.data, held, (tip, after, after))
        if self.scene.grasp == "weld":
            mujoco.mj_forward(self.model, self.data)
            weld(self.scene, self.data, held[0], True)

    def compensate(self, off: Array, sag: Array) -> None:
        """Replace the joint errors, (joints,), [rad]: true minus measured angles, and the sag, after calibration."""
        self._off = off
        self._sag = sag
        self._sags = bool(sag.any())
        if off.any() or sag.any():
            self.fidelity = "full"

    def steady(self, on: bool) -> None:
        """Start or stop the removal of creep (`hold_steady`) while held parts are carried; called at rest."""
        friction = self.scene.grasp == "friction"
        self._carried = Carried(self.forces.held) if on and friction and self.forces.held else None

    def _spans(self, line: Trajectory, s: Array, run_up_s: float) -> list[tuple[int, int]]:
        """Return the stretches of a line that are simulated, as first and last indices into `s`.

        With full fidelity this is the whole line; else the stretches where something is near, and always its end.
        """
        n = len(s) - 1
        if self.fidelity == "full":
            return [(0, n)]
        held = self.forces.held
        moving = moving_with_tip(self.scene, self.data, self.tip(), self.opening(), held)
        spans = find_near_spans(self.scene, self.data, moving, held, line, s, run_up_s=run_up_s)
        return spans if spans and spans[-1][1] == n else [*spans, (n, n)]

    def _pass(self, seconds: float) -> None:
        """Advance the time without simulation, with no force on the held parts."""
        self.data.time += seconds
        self.forces.wrist((0.0, 0.0, 0.0), min(seconds, WRIST_S))
        self.left_out_s += seconds

    def reached(self, q: Array | None) -> Array:
        """Return the joint angles; abort the execution if they are None, since a pose is out of reach."""
        if q is None:
            raise ExecutionAborted(self.stage, "unreachable_start" if self.stage in ("pick", "lift") else "unreachable")
        return q

    def _commands(self, targets: Array) -> Array:
        """Return the commands of all actuators, (n, controls), for joint targets, (n, joints), [rad].

        The joint errors are added, since MuJoCo's servos act on true angles. The fingers keep their command.
        """
        commands = np.repeat(self.data.ctrl[None], len(targets), axis=0)
        commands[:, self._drives] = self._true(targets) + self._droop
        return commands

    def _true(self, q: Array) -> Array:
        """Return the true joint angles at measured ones, (n, joints) at successive physics steps, [rad]."""
        if not self._sag.any():
            return np.asarray(q + self._off)
        n = len(q)
        at = np.unique(np.append(np.arange(0, n, _SAG_STEPS), n - 1))
        torque = np.array([self.scene.kinematics.gravity_torque(q[i]) for i in at])
        between = [np.interp(np.arange(n), at, of_joint) for of_joint in torque.T]
        return np.asarray(q + self._off - self._sag * np.transpose(between))

    def _run(self, targets: Array, guard: Guard | None) -> int:
        """Command joint targets, (n, joints), one for each physics step, until a guard stops the motion.

        Returns:
            How many steps were taken.
        """
        commands = self._commands(targets)
        for done in range(0, len(commands), self.steps_of_tick):
            tick = commands[done : done + self.steps_of_tick]
            stopped = self._tick(len(tick), tick, guard)
            if stopped or len(tick) == self.steps_of_tick:
                self.check_state()
            if stopped:
                return done + stopped
        return len(commands)

    def _tick(self, n: int, commands: Array | None = None, guard: Guard | None = None) -> int:
        """Take n physics steps, without checking the state between them.

        The forces on held parts, and those of a wrist sensor that is on, are read at each step. The others are needed
        by `check_state` only, so MuJoCo computes them for the last step only.

        Args:
            commands: Of all actuators before each step, (n, controls); None: they stay as they are.

        Returns:
            After how many steps the guard stopped the motion; 0 if it did not.
        """
        model = self.model
        data = self.data
        ctrl = data.ctrl
        if commands is None and self.wrist is None and not self.forces.held:
            with compute_only(model, data, []):
                mujoco.mj_step(model, data, n)
            return 0
        step_s = float(model.opt.timestep)
        sensors = self.forces.sensors
        rows = np.empty((n, len(sensors)))
        push = None if guard is None else self.forces.push(guard)
        newton = math.inf if guard is None else guard.newton
        stopped = False
        steps = 0
        with compute_only(model, data, self.forces.needed if self.wrist is None else slice(None)):
            while not stopped and steps < n:
                if commands is not None:
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

    def check_state(self) -> None:
        """Check the state once a tick: abort if the simulation diverged or the arm collided; then call the hook.

        Between these, the creep of carried parts is removed.
        """
        if has_failed(self.data):
            raise ExecutionAborted(self.stage, "unstable_simulation")
        if self._carried is not None:
            self._carried = hold_steady(self.scene.work, self.data, self.tip(), self._carried)
        if obstacle := self.forces.find_collision():
            raise ExecutionAborted(self.stage, "collision", obstacle)
        if self.hooks.after_tick is not None:
            macro = self.macro if self.stage == "attach" else self.stage
            k, undoes = self.step or (None, False)
            self.hooks.after_tick(self.data, Phase(k, macro, math.hypot(*self.forces.wrist.force), undoes))
