"""Control the tip of the arm between two actions of an agent.

The robot knows what it commands, its encoders, its opening, the force on the part in its hand and the wrench at its
wrist; nothing here reads where a part is.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import Poses, Snapshot
from apo_bench.geometry import Array, pose
from apo_bench.simulation.execution import (
    check_hold,
    choose_pace,
    depart,
    find_attach_end,
    finish_attach,
    release,
    restore_state,
    wait_for_rest,
)
from apo_bench.simulation.hooks import Hooks
from apo_bench.simulation.robot import LowPass, Robot, translate
from apo_bench.simulation.scene import Scene, allow_sleep, get_part_pose, switch_wrist_sensors_on, take_snapshot
from apo_bench.simulation.task.start import Start

PERIOD_S = 0.05
"""From one action to the next: 20 Hz."""
_YIELD = 0.0005
"""How fast the tip gives way to a newton, [m/s/N], as in a search."""
_AVERAGED_S = 0.01
"""Forces are averaged over this time."""
_GAIN = 0.6  # [m/s^2]: how fast the approach gains speed in free air
_SOFT = 0.02  # [m/s^2]: and after a first touch
_FEED = 0.005  # [m/s]: its greatest speed once it was stopped
_EASE = 0.02  # [m/s]: and deeper than that by `_DEEP_M`
_DEEP_M = 0.001
_MET = 0.8
"""The light push is met from this part of it on."""
_STRUCK = 0.03
"""Faster than this, [m/s], it stops by the force of a single step; else by the average."""
_ACROSS_M = 0.015  # actions move the tip off the line of the approach by this at most
_TURN_RAD = math.radians(10.0)  # and turn it by this
_BACK_M = 0.01  # behind its start by this
_BEYOND_M = 0.003  # and beyond the end of the line by this
_ARRIVED_M = 0.0002  # the approach has arrived this near to its end
_PUSHED = 4  # or pushed back at so many actions in a row
_NEAR_M = 0.002  # and this near


class TipReading(NamedTuple):
    """What the robot knows after an action, in the frame of the insertion axis, its third axis."""

    tip: Array
    """(6,), measured less where the line ends, [m, rad]: of the estimated front of the part, and its turn."""
    lag: Array
    """(6,), commanded less measured, [m, rad]."""
    opening: float
    """Of each finger less half the width of the part, [m]."""
    wrench: Array
    """(6,), on the hand and what is in it, about the flange, [N, Nm]."""


@final
class TipControl:
    """One episode: the arm from its start until it lets go."""

    def __init__(self, scene: Scene, start: Start, rng: np.random.Generator, nominal: bool = True) -> None:
        """Take up a start.

        Args:
            rng: Of the noise of the wrist.
            nominal: Whether the arm goes in by itself, and actions are added to that.
        """
        self.start = start
        self.nominal = nominal
        self.arrived = False
        """Whether the approach is over and would let go."""
        self.robot = robot = Robot(scene, start.parts, Hooks(), "near-contact")
        robot.compensate(start.off)
        restore_state(start.saved, robot)
        robot.stage, robot.macro = "attach", "insert"
        t = start.transfer
        self._wrist = start.wrist.at(robot.data.sensordata, robot.encoders, rng)
        self._end = find_attach_end(t, start.grip, start.second)
        self._front = pose.apply(pose.inverse(start.grip.T_part_tip), t.foremost[None])[0]
        self._R = frame_of_direction(t.into.direction, self._end)
        self._pace = choose_pace(t, start.second)
        self._guard = t.insert_n if t.into.level else t.place_n
        self._left = 0.0 if start.second is None else float(t.into.left or 0.0)
        self._stuck = max(_NEAR_M, 0.0 if t.into.level else t.stuck)
        self._filtered = LowPass(_AVERAGED_S)
        self._force = robot.forces.net()
        self._speed = 0.0
        self._stopped: float | None = None
        self._pushed = 0
        self._passed = 0
        self._turn: Array = np.zeros(3)
        self._at: Array = self._off(robot.T)[:3]
        self.begins = -float(self._at[2])
        """How far before the end of the line it begins, [m]."""
        with self._stepping():
            self.reading = self._read()

    def act(self, shift: Array, turn: Array) -> None:
        """One period: move the tip by the action, and go on with the approach.

        Args:
            shift: (3,), of the front of the part in the frame of the way in, [m].
            turn: (3,), a rotation vector about the front in that frame, [rad].

        Raises:
            ExecutionAborted: Something was struck, or fell out of the hand.
        """
        with self._stepping():
            self._move(shift, turn)
            check_hold(self.robot, self.start.grip)
            self.reading = self._read()

    def let_go(self) -> Snapshot:
        """Open the fingers, do what the operation still has after an approach that arrived, and wait until parts rest.

        Raises:
            ExecutionAborted: Something went wrong; what was reached then is never judged.
        """
        robot = self.robot
        t = self.start.transfer
        work = robot.scene.work
        with allow_sleep(work, robot.scene.grasp == "friction"), robot.watch_stability():
            robot.stand()
            if self.arrived:
                at_end = translate(robot.T, t.into.direction, -float(self._off(robot.T)[2]))
                finish_attach(robot, t, self.start.grip, self.start.second, at_end @ pose.inverse(self._end))
            else:
                release(robot, t, self.start.grip)
                depart(robot, t)
            wait_for_rest(robot)
            return take_snapshot(work, robot.data, self.start.parts)

    def sigmas(self, covariance: Array) -> Array:
        """Standard deviations in the frame of the way in, of the front and of the turn, (6,), [m, rad].

        Args:
            covariance: (6, 6), of the twist of the part in its own frame, [m, rad].
        """
        t = self.start.transfer
        R = self._R.T @ t.T_world_goal[:3, :3]
        # A twist (v, w) of the part shifts its front by v + w x front.
        J = np.block([[R, -R @ pose.hat(t.foremost)], [np.zeros((3, 3)), R]])
        return np.asarray(np.sqrt(np.diag(J @ covariance @ J.T)))

    def off(self, goals: Sequence[Array]) -> Array:
        """By how much the front of the part, and its turn, are off the lines to such poses of it, (6,), [m, rad].

        The mean, in the frame of the way in; the third number is less than 0 before the end. For observers, as `poses`.
        """
        t = self.start.transfer
        T = get_part_pose(self.robot.scene.work, self.robot.data, t.part)
        front = t.foremost[None]
        found = []
        for goal in goals:
            direction = goal[:3, :3] @ t.T_world_goal[:3, :3].T @ t.into.direction
            far = pose.apply(T, front)[0] - pose.apply(goal, front)[0]
            turn = pose.log(pose.rigid(T[:3, :3] @ goal[:3, :3].T, np.zeros(3)))[3:]
            across = (far - (far @ direction) * direction) @ self._R
            found.append([*across[:2], far @ direction, *turn @ self._R])
        return np.asarray(np.mean(found, axis=0))

    def poses(self) -> Poses:
        """Where all parts are, (4, 4) each, world: for observers; nothing is decided by it."""
        work = self.robot.scene.work
        return {**self.start.parts, **{part: get_part_pose(work, self.robot.data, part) for part in work.free}}

    @property
    def force_n(self) -> float:
        """On what is in the hand, behind a filter of 8 Hz, [N]."""
        return math.hypot(*self.robot.forces.wrist.force)

    @contextmanager
    def _stepping(self) -> Iterator[None]:
        robot = self.robot
        work = robot.scene.work
        asleep = allow_sleep(work, robot.scene.grasp == "friction")
        with asleep, switch_wrist_sensors_on(work.model), robot.watch_stability():
            yield

    def _move(self, shift: Array, turn: Array) -> None:
        robot = self.robot
        dt = robot.step_s
        steps = round(PERIOD_S / dt)
        direction = self.start.transfer.into.direction
        T = robot.T
        off = self._off(T)
        low = np.array([-_ACROSS_M, -_ACROSS_M, -self.begins - _BACK_M])
        high = np.array([_ACROSS_M, _ACROSS_M, _BEYOND_M])
        # What the linear kinematics of the last period left behind is made up for.
        wanted = self._R @ (np.clip(off[:3] + shift, low, high) + self._at - 2 * off[:3]) / PERIOD_S
        from_there = off[:3]
        moved = np.zeros(3)
        self._turn = np.clip(self._turn + turn, -_TURN_RAD, _TURN_RAD)
        # The tip turns about the front: v_tip = v_front + w x (tip - front), all in the frame of the tip.
        R = T[:3, :3]
        w = R.T @ self._R @ (self._turn - off[3:]) / PERIOD_S
        twist = np.concatenate([np.cross(w, -self._front), w])
        back = robot.scene.kinematics.inverse_jacobian(robot.q)
        turning = back @ twist
        shifting = back[:, :3] @ R.T
        q = robot.q
        left = self._left - float(off[2])
        for _ in range(steps):
            f = np.array(self._filtered(self._force, dt))
            push = -float(f @ direction)
            advance = wanted
            yields = _YIELD * f
            if self.nominal:
                side = math.sqrt(max(float(f @ f) - push * push, 0.0))
                struck = -float(np.dot(self._force, direction)) if self._speed > _STRUCK else push
                if self._stopped is None and max(struck, side) > self._guard:
                    q = robot.encoders()
                    from_there = self._off(robot.scene.kinematics.forward(q))[:3]
                    moved = np.zeros(3)
                    self._speed, self._stopped = 0.0, left
                advance = wanted + self._ahead(left, push, side, dt) * direction
                yields = yields + _YIELD * push * direction
            moved = moved + dt * (advance + yields)
            left = self._left - float(from_there[2] + moved @ direction)
            leads = turning + shifting @ advance
            q = q + dt * (leads + shifting @ yields)
            self._passed += 1
            self._force = robot.servo_step(q, self._passed, leads)
            self._wrist.take(dt)
        self._at = from_there + moved @ self._R
        robot.q = q
        robot.T = robot.scene.kinematics.forward(q)
        push = -float(np.dot(self._filtered.force, direction))
        self._pushed = self._pushed + 1 if push > self.start.transfer.slide_n / 2 else 0
        here = left - self._pace.end
        self.arrived = here < _ARRIVED_M or (self._pushed >= _PUSHED and left - self._left < self._stuck)

    def _ahead(self, left: float, push: float, side: float, dt: float) -> float:
        """How fast the approach goes on, [m/s], so far before the goal, [m]: as it may, or under a light push."""
        weigh = self.start.transfer.slide_n
        if self._stopped is None:
            self._speed = min(self._speed + _GAIN * dt, self._limit(left))
        elif push > _MET * weigh:
            self._speed = _YIELD * (weigh - push)
        elif push < weigh / 4:
            most = _FEED if left > self._stopped - _DEEP_M else _EASE
            most *= max(0.0, 1.0 - side / (2 * weigh))
            self._speed = min(max(self._speed, 0.0) + _SOFT * dt, most, self._limit(left))
        return self._speed

    def _limit(self, left: float) -> float:
        """The speed from which slow stretches are reached slowly: v^2 = v_slow^2 + 2 a d."""
        most = min(self._pace.quick, math.sqrt(2 * _GAIN * max(left - self._pace.end, 0.0)))
        for begin, end, slow in self._pace.stretches:
            if left > begin:
                most = min(most, math.sqrt(slow**2 + 2 * _GAIN * (left - begin)))
            elif left >= end:
                most = min(most, slow)
        return most

    def _off(self, T: Array) -> Array:
        """Where a tip pose is, less where the line ends, (6,), in the frame of the way in, [m, rad]; of the front."""
        shift = pose.apply(T, self._front[None])[0] - pose.apply(self._end, self._front[None])[0]
        turn = pose.log(pose.rigid(T[:3, :3] @ self._end[:3, :3].T, np.zeros(3)))[3:]
        return np.concatenate([shift @ self._R, turn @ self._R])

    def _read(self) -> TipReading:
        robot = self.robot
        tip = self._off(robot.scene.kinematics.forward(robot.encoders()))
        wrench = self._wrist.wrench_there().reshape(2, 3) @ self._R
        return TipReading(tip, self._off(robot.T) - tip, robot.opening() - self.start.grip.half_width, wrench.ravel())


def frame_of_direction(direction: Array, T_tip: Array) -> Array:
    """A frame whose third axis leads along a way, as columns in the world, (3, 3).

    The first axis is that along which the fingers close, as far as it is square to the way.
    """
    first = T_tip[:3, 0] if abs(T_tip[:3, 0] @ direction) < 0.7 else T_tip[:3, 1]
    first = first - (first @ direction) * direction
    first = first / np.linalg.norm(first)
    return np.column_stack([first, np.cross(direction, first), direction])
