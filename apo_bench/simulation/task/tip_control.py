"""Control the tip of the arm during an episode: add the actions of an agent to a compliant approach into the hole.

The robot knows its commands, its encoders, the opening of its fingers, the force on the held part and the wrench at its
wrist. No command depends on the true pose of a part. The file is long because all methods change one state, the arm
during an episode.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
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
from apo_bench.simulation.frames import cross, rotation_vector
from apo_bench.simulation.hooks import Hooks
from apo_bench.simulation.robot import ForceSteps, LowPass, Robot, translate
from apo_bench.simulation.scene import (
    Scene,
    allow_sleep,
    get_part_pose,
    switch_wrist_sensors_on,
    take_snapshot,
    touches_others,
)
from apo_bench.simulation.task.start import Start

PERIOD_S = 0.05
"""Time between two actions: 20 Hz."""
_YIELD = 0.0005
"""Admittance of the tip, [m/s/N], as in a search."""
_AVERAGED_S = 0.01
"""Time constant of the force filter."""
_GAIN = 0.6  # acceleration of the approach in free air, [m/s^2]
_SOFT = 0.02  # acceleration of the approach after its first contact, [m/s^2]
_FEED = 0.005  # greatest speed of the approach after its first contact, [m/s],
_EASE = 0.02  # and once it is deeper than this contact by `_DEEP_M`, [m/s]
_DEEP_M = 0.001  # depth beyond the first contact from which the part is in the hole
_MET = 0.8  # fraction of the light push from which the approach controls the force
_FAST_M_S = 0.03
"""Speed above which the force of a single step stops the approach, [m/s]; below, the filtered force does."""
_ACROSS_M = 0.015  # greatest lateral offset of the tip from the line of the approach
_TURN_RAD = math.radians(10.0)  # greatest turn by the actions, about each axis
_BACK_M = 0.01  # greatest distance of the tip behind its start
_BEYOND_M = 0.003  # greatest distance of the tip beyond the end of the line
_ARRIVED_M = 0.0002  # distance to its end at which the approach has arrived;
_PUSHED = 4  # it has also arrived if it was pushed back at this number of actions in a row
_NEAR_M = 0.002  # within this distance of its end, or that of `Transfer.stuck`


class TipReading(NamedTuple):
    """The measurements of the robot after an action, in a frame whose third axis is the insertion axis."""

    tip: Array
    """Measured pose less that at the end of the line, (6,), [m, rad]: position of the part's estimated front, turn."""
    lag: Array
    """Commanded less measured pose, (6,), [m, rad]."""
    opening: float
    """Opening of each finger less half the width of the part, [m]."""
    wrench: Array
    """External wrench on the hand and the held parts, about the flange, (6,), [N, Nm]."""


@final
class TipControl:
    """The arm during one episode, from its start to the release of the part."""

    def __init__(self, scene: Scene, start: Start, rng: np.random.Generator, nominal: bool = True) -> None:
        """Restore a start in a new simulation.

        Args:
            rng: Source of the noise of the wrist sensor.
            nominal: Whether the arm approaches the goal by itself, and actions are added to this motion.
        """
        self.start = start
        self.nominal = nominal
        self.arrived = False
        """Whether the approach is over, so that the part would be released."""
        self.robot = robot = Robot(scene, start.parts, Hooks(), "near-contact")
        robot.compensate(start.off, start.sag)
        restore_state(start.saved, robot)
        robot.stage, robot.macro = "attach", "insert"
        t = start.transfer
        self._wrist = start.wrist.at(robot.data.sensordata, robot.encoders, rng)
        self._end = find_attach_end(t, start.grip, start.second)  # tip pose at the end of the line
        # The part ends beside or above its goal where slides and lowering follow: pose there in the frame of its goal.
        self._T_goal_end = (
            pose.inverse(t.T_world_goal) @ find_attach_end(t, start.grip, None) @ pose.inverse(start.grip.T_part_tip)
        )
        self._front = pose.apply(pose.inverse(start.grip.T_part_tip), t.foremost[None])[0]  # in the frame of the tip
        self._R = frame_of_direction(t.into.direction, self._end)  # frame of the insertion axis, in the world
        self._pace = choose_pace(t, start.second)
        self._guard = t.insert_n if t.into.level else t.place_n
        self._left = 0.0 if start.second is None else float(t.into.left or 0.0)  # end of the line to the goal, [m]
        self._stuck = max(_NEAR_M, 0.0 if t.into.level else t.stuck)
        self._filtered = LowPass(_AVERAGED_S)
        self._steps = ForceSteps(robot, self._wrist, self._R)
        self._speed = 0.0  # of the approach, [m/s]
        self._stopped: float | None = None  # distance to the goal at the first contact, [m]
        self._pushed = 0  # number of actions in a row with a push back
        self._turn: Array = np.zeros(3)  # sum of the turns by actions
        self._at: Array = self._off(robot.T)[:3]  # position of the front by linear kinematics, off the line's end
        self.begins = -float(self._at[2])
        """Distance of the start before the end of the line, [m]."""
        with self._stepping():
            self.reading = self._read()

    def act(self, shift: Array, turn: Array) -> None:
        """Simulate one period: move the tip by the action, and continue the approach.

        Args:
            shift: Shift of the front of the part, (3,), in the frame of the insertion axis, [m].
            turn: Rotation vector about the front, (3,), in the same frame, [rad].

        Raises:
            ExecutionAborted: The arm collided, or the part fell out of the hand.
        """
        with self._stepping():
            self._move(shift, turn)
            check_hold(self.robot, self.start.grip)
            self.reading = self._read()

    def let_go(self) -> Snapshot:
        """End the episode: finish the operation if the approach arrived, else release the part; then wait for rest.

        Returns:
            The snapshot of the parts at rest.

        Raises:
            ExecutionAborted: Something went wrong; the poses reached are then not judged.
        """
        robot = self.robot
        t = self.start.transfer
        work = robot.scene.work
        with allow_sleep(work, robot.scene.grasp == "friction"), robot.watch_stability():
            robot.stand()
            if self.arrived:
                # The tip pose shifted along the axis to the depth of the end of the line.
                at_end = translate(robot.T, t.into.direction, -float(self._off(robot.T)[2]))
                finish_attach(robot, t, self.start.grip, self.start.second, at_end @ pose.inverse(self._end))
            else:
                release(robot, t, self.start.grip)
                depart(robot, t)
            wait_for_rest(robot)
            return take_snapshot(work, robot.data, self.start.parts)

    def sigmas(self, covariance: Array) -> Array:
        """Return the standard deviations of front and turn in the frame of the insertion axis, (6,), [m, rad].

        Args:
            covariance: Covariance of the shift of the front and of its rotation, (6, 6), world axes, [m, rad].
        """
        R = np.kron(np.eye(2), self._R)
        return np.asarray(np.sqrt(np.diag(R.T @ covariance @ R)))

    def off(self, goals: Sequence[Array]) -> Array:
        """Return the true offset of the part from the lines to its goals, averaged over the goals, (6,), [m, rad].

        For observers only, as `poses`. Where slides or lowering to the goal follow, the lines end before these.

        Args:
            goals: Goal poses of the part, (4, 4) each, world: one relative to each neighbouring part.

        Returns:
            Offset of the front, two lateral numbers and one along the axis, negative before the goal; then the turn as
            a rotation vector. All are in the frame of the insertion axis.
        """
        t = self.start.transfer
        T = get_part_pose(self.robot.scene.work, self.robot.data, t.part)
        front = t.foremost[None]
        found = []
        for goal in goals:
            direction = goal[:3, :3] @ t.T_world_goal[:3, :3].T @ t.into.direction
            far = pose.apply(T, front)[0] - pose.apply(goal @ self._T_goal_end, front)[0]  # offset of the front
            turn = rotation_vector(T[:3, :3] @ goal[:3, :3].T)
            across = (far - (far @ direction) * direction) @ self._R
            found.append([*across[:2], far @ direction, *turn @ self._R])
        return np.asarray(np.mean(found, axis=0))

    def poses(self) -> Poses:
        """Return the true poses of all parts, (4, 4) each, world, for observers only; no command depends on them."""
        work = self.robot.scene.work
        return {**self.start.parts, **{part: get_part_pose(work, self.robot.data, part) for part in work.free}}

    @property
    def left(self) -> float:
        """Distance from the end of the line to the goal, [m]; above 0 if the grip changes there."""
        return self._left

    @property
    def entrance(self) -> Array:
        """The entrance of the hole by the robot's own estimate, (3,), world, [m]; without one, where the part ends."""
        end = pose.apply(self._end, self._front[None])[0]
        deep = max(self.start.transfer.entrances, default=self._left) - self._left
        return np.asarray(end - deep * self.start.transfer.into.direction)

    @property
    def in_free_air(self) -> bool:
        """Whether the approach has met no contact yet."""
        return self._stopped is None

    @property
    def contact_force(self) -> Array:
        """The true contact force on the held parts, (3,), in the frame of the insertion axis, [N]; for observers."""
        return np.array(self._steps.force)

    @property
    def touches(self) -> bool:
        """Whether the held parts touch anything but the hand, for observers only."""
        return touches_others(self.robot.scene.work, self.robot.data, self.robot.forces.held)

    @property
    def force_n(self) -> float:
        """Magnitude of the contact force on the held parts behind a filter of 8 Hz, [N]."""
        return math.hypot(*self.robot.forces.wrist.force)

    @contextmanager
    def _stepping(self) -> Iterator[None]:
        """Within this context physics steps are taken: wrist sensors on, sleeping as allowed, stability watched."""
        robot = self.robot
        work = robot.scene.work
        asleep = allow_sleep(work, robot.scene.grasp == "friction")
        with asleep, switch_wrist_sensors_on(work.model), robot.watch_stability():
            yield

    def _move(self, shift: Array, turn: Array) -> None:
        """Simulate the physics steps of one period and update `arrived`; arguments as for `act`.

        The tip velocity at each step is the sum of the action, the approach and the admittance to the contact force.
        """
        robot = self.robot
        dt = robot.step_s
        steps = round(PERIOD_S / dt)
        T = robot.T
        off = self._off(T)
        # Limits of the front's position, in the frame of the axis; so are all vectors below, as plain numbers.
        low = np.array([-_ACROSS_M, -_ACROSS_M, -self.begins - _BACK_M])
        high = np.array([_ACROSS_M, _ACROSS_M, _BEYOND_M])
        # Velocity of the front by the action; it also corrects the linearisation error of the last period.
        x, y, z = ((np.clip(off[:3] + shift, low, high) + self._at - 2 * off[:3]) / PERIOD_S).tolist()
        from_there = off[:3].tolist()
        moved = [0.0, 0.0, 0.0]
        self._turn = np.clip(self._turn + turn, -_TURN_RAD, _TURN_RAD)
        # The tip turns about the front: v_tip = v_front + w x (tip - front), all in the frame of the tip.
        R = T[:3, :3]
        w = R.T @ self._R @ (self._turn - off[3:]) / PERIOD_S
        twist = np.concatenate([cross(w, -self._front), w])
        back = robot.scene.kinematics.inverse_jacobian(robot.q)
        turning = back @ twist
        shifting = np.ascontiguousarray(back[:, :3] @ R.T @ self._R)
        q = robot.q
        left = self._left - from_there[2]  # distance to the goal, [m]
        force = self._steps.force
        with closing(self._steps.ticks(steps)) as ticks:
            for count in ticks:
                for _ in range(count):
                    fx, fy, fz = self._filtered(force, dt)
                    ahead, along = 0.0, _YIELD * fz
                    if self.nominal:
                        side = math.hypot(fx, fy)
                        # Fast: unfiltered force, since the filter would react too late.
                        sudden = -(force[2] if self._speed > _FAST_M_S else fz)
                        if self._stopped is None and max(sudden, side) > self._guard:
                            # First contact: continue from the measured joint angles, which takes the pressure away.
                            q = robot.encoders()
                            from_there = self._off(robot.scene.kinematics.forward(q))[:3].tolist()
                            moved = [0.0, 0.0, 0.0]
                            self._speed, self._stopped = 0.0, left
                        # Yields are lateral only: `_ahead` controls the force along the axis.
                        ahead, along = self._ahead(left, -fz, side, dt), 0.0
                    advance, yields = (x, y, z + ahead), (_YIELD * fx, _YIELD * fy, along)
                    moved = [m + dt * (a + b) for m, a, b in zip(moved, advance, yields, strict=True)]
                    left = self._left - (from_there[2] + moved[2])
                    leads = turning + shifting.dot(advance)  # joint velocities for the feedforward
                    q = q + dt * (leads + shifting.dot(yields))
                    force = self._steps.step(q, leads)
        self._at = np.array(from_there) + moved
        robot.q = q
        robot.T = robot.scene.kinematics.forward(q)
        self._pushed = self._pushed + 1 if -self._filtered.force[2] > self.start.transfer.slide_n / 2 else 0
        here = left - self._pace.end  # distance to the end of the motion
        self.arrived = here < _ARRIVED_M or (self._pushed >= _PUSHED and left - self._left < self._stuck)

    def _ahead(self, left: float, push: float, side: float, dt: float) -> float:
        """Return the speed of the approach at this step, [m/s].

        Before the first contact it rises to the speed limit. Afterwards the approach keeps a light push of
        `Transfer.slide_n` in contact, and moves ahead slowly without contact.

        Args:
            left: Distance to the goal, [m].
            push: Filtered force against the direction, [N].
            side: Filtered lateral force, [N].
            dt: Physics step, [s].
        """
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
        """Return the greatest speed at a distance to the goal, [m/s], that allows braking before slow stretches.

        At a distance d before a stretch, v^2 = v_slow^2 + 2 a d with the acceleration a.
        """
        most = min(self._pace.quick, math.sqrt(2 * _GAIN * max(left - self._pace.end, 0.0)))
        for begin, end, slow in self._pace.stretches:
            if left > begin:
                most = min(most, math.sqrt(slow**2 + 2 * _GAIN * (left - begin)))
            elif left >= end:
                most = min(most, slow)
        return most

    def _off(self, T: Array) -> Array:
        """Return the offset of a tip pose from the end of the line, (6,), in the frame of the insertion axis, [m, rad].

        The first three numbers are the shift of the front of the part, the others a rotation vector.
        """
        shift = pose.apply(T, self._front[None])[0] - pose.apply(self._end, self._front[None])[0]
        turn = rotation_vector(T[:3, :3] @ self._end[:3, :3].T)
        return np.concatenate([shift @ self._R, turn @ self._R])

    def _read(self) -> TipReading:
        """Return the present measurements."""
        robot = self.robot
        tip = self._off(robot.scene.kinematics.forward(robot.encoders()))
        wrench = self._wrist.wrench_there().reshape(2, 3) @ self._R
        return TipReading(tip, self._off(robot.T) - tip, robot.opening() - self.start.grip.half_width, wrench.ravel())


def frame_of_direction(direction: Array, T_tip: Array) -> Array:
    """Return a rotation matrix, (3, 3), whose third column is a direction in the world.

    Its first column is the closing direction of the fingers, made perpendicular to the direction. If both are within 45
    degrees, the y axis of the tip is used instead.

    Args:
        direction: Unit vector, (3,), world.
        T_tip: Pose of the tip, (4, 4), world.
    """
    first = T_tip[:3, 0] if abs(T_tip[:3, 0] @ direction) < 0.7 else T_tip[:3, 1]
    first = first - (first @ direction) * direction
    first = first / np.linalg.norm(first)
    return np.column_stack([first, np.cross(direction, first), direction])
