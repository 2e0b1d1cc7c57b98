"""The calibration that a robot estimates by probing during one replay, and the commands that compensate for it.

The robot knows its commands, its encoders, the opening of the gripper and the wrench at its wrist. It also knows the
plan, the part files and the estimated poses of fixed parts. The drawn errors move the hand away from where the robot
expects it, as in every replay. `estimated_tip` removes them again, since it returns the pose that the encoders show.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from apo_bench.assembly import Plan, Touch
from apo_bench.geometry import Array, pose
from apo_bench.simulation.execution.flat_placement import FlatPlacement
from apo_bench.simulation.execution.probing.config import CalibrationEstimate, ProbingConfig
from apo_bench.simulation.execution.transfer import Grip
from apo_bench.simulation.robot import Robot, RobotError, WristSensor, compute_sag_per_metre, get_wrist, zero
from apo_bench.simulation.scene import Scene

TOUCH_SIGMA_M = 3e-5
"""Standard deviation of a guarded touch of a plane, [m]."""
FOOT_SIGMA_M = 1e-4
"""Standard deviation of the height of a foot on the floor, [m]: under the press it sinks in by as much."""
SQUARED = np.array([5e-5, 2e-4, 1e-3, 5e-3, 3e-3, 3e-3])
"""Standard deviations of the pose of a part between pads that closed twice, [m, rad], as a twist of the tip.

Closing tilts a round part by 0.3 degrees, and under the press it slides up between the pads.
"""
PADS = -1
"""Number of the grasp that stands for the pads of the open hand, as if the hand held them."""
_CORNERS = 3  # iterations of the update, in each of which the touching corner of the hand is determined
_FLAT_M = 1e-5  # a patch whose corners are level within this touches with its middle
_OFF_SIGMAS = 3.0  # assumed greatest error of the tip, in standard deviations
_TOUCH_N = 2.0  # [N]: least force that ends a touch
_SIGMAS = 6.0  # least force that ends a touch, in standard deviations of the wrist sensor


def touch_guard(sigma_n: float) -> float:
    """Return the force that ends a touch, [N], for a sensor with a standard deviation, [N]."""
    return max(_TOUCH_N, _SIGMAS * sigma_n)


class ProbingState:
    """The calibration estimate of a probing robot during one replay, and the errors that remain."""

    def __init__(self, probing: ProbingConfig, plan: Plan, scene: Scene, error: RobotError | None) -> None:
        """Start from the estimate of the configuration, without compensation.

        Args:
            error: The drawn errors of the robot; None: no errors.
        """
        none = np.eye(4)
        joints = np.zeros(len(scene.arm.joints))
        self.plan = plan
        self.has_unknown_pads = probing.pads_m > 0.0
        """Whether the middle between the pads is uncertain, so that they are probed."""
        pads = np.eye(6)[0] * probing.pads_m
        self.estimate = probing.estimate.grasp(PADS, pads) if self.has_unknown_pads else probing.estimate
        self._config = probing
        self._wrist: WristSensor | None = None
        self._kinematics = scene.kinematics
        self._sag_per_metre = compute_sag_per_metre(scene) if self.estimate.sags else np.zeros(1)
        self._error = error or RobotError(none, joints, none, np.tile(none, (len(plan.assembly), 1, 1)))
        self.residual = self._error
        """The drawn errors less those for which the commands compensate."""

    def begin(self, robot: Robot) -> None:
        """Create the wrist sensor and tare it in free air."""
        self._wrist = get_wrist(robot, self._config.ft_sensor, np.random.default_rng(self._config.seed))
        zero(robot, self._wrist)

    @property
    def wrist(self) -> WristSensor:
        """The wrist sensor, tared by `begin`."""
        assert self._wrist is not None, "begin first"
        return self._wrist

    @property
    def touch_n(self) -> float:
        """The force that ends a touch, [N], well above the sensor noise."""
        return touch_guard(self.wrist.sigma[0])

    def off_m(self, robot: Robot, T_world_tip: Array, direction: Array) -> float:
        """Return three standard deviations of the tip's estimate along a direction, (3,), world, [m]."""
        covariance = self.estimate.covariance_of(T_world_tip, self.jacobian(robot))[:3, :3]
        direction = T_world_tip[:3, :3].T @ direction
        return _OFF_SIGMAS * float(np.sqrt(direction @ covariance @ direction))

    def plane_by_camera(self, normal: Array, point: Array) -> tuple[Array, float]:
        """Return a plane of the camera's world frame in the frame that the arm takes for the world.

        Args:
            normal: Unit normal in the camera's frame, (3,).
            point: A point of the plane in the camera's frame, (3,), [m].

        Returns:
            Normal, (3,), and offset, [m].
        """
        back = pose.inverse(self.residual.hand_eye)
        n = back[:3, :3] @ normal
        return n, float(n @ (back[:3, :3] @ point + back[:3, 3]))

    def estimated_tip(self, robot: Robot, holds: bool) -> Array:
        """Return the tip pose that the robot would estimate from its encoders without compensation, (4, 4), world.

        Args:
            holds: Whether the middle between the pads, which hold a part or touch themselves, stands for the tip.
        """
        left = self.residual
        hand = left.pads if holds else left.tool
        measured = self._kinematics.forward(robot.encoders())
        corrected = pose.inverse(left.hand_eye) @ measured @ pose.inverse(hand)
        return self.estimate.command(corrected, self.jacobian(robot))

    def jacobian(self, robot: Robot) -> Array:
        """Return the body Jacobian of the tip at the commanded joint angles, (6, joints), with the sag if stated."""
        J = self._kinematics.jacobian(robot.q)
        if not self.estimate.sags:
            return J
        return np.column_stack([J, -J @ (self._sag_per_metre * self._kinematics.gravity_torque(robot.q))])

    def learn(self, robot: Robot, touches: Sequence[tuple[Touch, Array]], differ: bool = False) -> None:
        """Update the estimate by touches of the hand; from now on commands compensate for it.

        Args:
            touches: Each with the corners of its touching area, (k, 3), in the frame of the tip, [m]. By the estimate,
                a tilted hand touches with its foremost corner.
            differ: Whether only the differences between the touches count, since the fingers give way. All touches are
                then of one wall.
        """
        before = self.estimate
        for _ in range(_CORNERS):
            cornered = [self._cornered(touch, patch) for touch, patch in touches]
            self.estimate = before.touch(*(_less_common(before, cornered) if differ else cornered))
        # From the drawn errors, not from the last residual: the estimate is of the whole errors.
        left = self._error
        E = self.estimate.hand_eye
        tool = np.array(left.tool)
        tool[:3, 3] -= self.estimate.tool
        self.residual = replace(
            left,
            hand_eye=left.hand_eye @ pose.inverse(E),
            tool=tool,
            joints=left.joints - self.estimate.encoders,
            sag=left.sag - self.estimate.sag * self._sag_per_metre,
            finger=left.finger - 2.0 * self._found_pads(),
        )
        robot.compensate(self.residual.joints, self.residual.sag)

    def _found_pads(self) -> float:
        """Return the estimated offset of the middle between the pads, along x of the tip, [m]."""
        return float(self.estimate.held(PADS, np.eye(4))[0, 3]) if self.has_unknown_pads else 0.0

    def _cornered(self, touch: Touch, patch: Array) -> Touch:
        """Return the touch with the foremost corner of the patch by the present estimate, or its middle if level."""
        # Heights of the corners over the face; the lowest one touches.
        ahead = pose.apply(self.estimate.real(touch.T_world_tip, touch.jacobian), patch) @ touch.normal
        flat = float(np.ptp(ahead)) < _FLAT_M
        return replace(touch, point=patch.mean(axis=0) if flat else patch[int(np.argmin(ahead))])

    def note_grasp(self, operation: int) -> None:
        """Add a part that was picked to the estimate; its pose varies by squaring and by slip."""
        self.estimate = self.estimate.grasp(operation, np.hypot(self._config.slip, SQUARED))

    def T_tip_held(self, T_tip_part: Array) -> Array:
        """Return the pose of a held part in the frame of the arm's nominal tip, (4, 4), from that of the real tip."""
        return np.asarray(pose.inverse(self.residual.pads) @ T_tip_part)

    def foot(self, robot: Robot, operation: int, flat: FlatPlacement, T_tip_part: Array, foot: Array) -> Touch:
        """Return the touch of the floor with one foot of the held part.

        Args:
            T_tip_part: Pose of the part in the frame of the tip as estimated at the pick, (4, 4).
            foot: In the frame of the part, (3,), [m].
        """
        n, d = self.plane_by_camera(flat.normal, pose.apply(flat.T, flat.feet[:1])[0])
        return self.touch(robot, n, d, foot, (operation, T_tip_part), FOOT_SIGMA_M)

    def grip(self, operation: int, touches: Sequence[Touch], T_tip_part: Array, grip: Grip) -> Grip:
        """Update the estimate of the pose of a held part by its touches; return the updated grip.

        The commands keep their compensation, since parts that are placed already stand where this put them.

        Args:
            T_tip_part: Pose of the part in the frame of the tip as estimated at the pick, (4, 4).
            grip: The present grip.
        """
        self.estimate = self.estimate.touch(*touches)
        held = self.estimate.held(operation, T_tip_part)
        return Grip(pose.inverse(held) @ self.residual.pads, grip.half_width)

    def touch(
        self,
        robot: Robot,
        normal: Array,
        offset: float,
        point: Array,
        held: tuple[int, Array] | None = None,
        sigma_m: float = TOUCH_SIGMA_M,
    ) -> Touch:
        """Return the touch of a plane at the present pose of the robot.

        Args:
            normal: Unit normal of the plane, (3,).
            offset: The plane is normal . x = offset, [m].
            point: The point that touches, (3,), [m], in the frame of the held part, or of the tip of an empty hand.
            held: The operation that grasped the part, and its estimated pose in the frame of the tip, (4, 4); None: an
                empty hand.
            sigma_m: Standard deviation of the touch.
        """
        J = self.jacobian(robot)
        grasp, T_tip_part = held or (None, None)
        return Touch(self.estimated_tip(robot, held is not None), normal, offset, point, sigma_m, J, grasp, T_tip_part)


def _less_common(estimate: CalibrationEstimate, touches: Sequence[Touch]) -> list[Touch]:
    """Remove the mean residual of touches of one wall from their offsets, so that only their differences count.

    A single touch has no difference; then the list is empty.
    """
    if len(touches) < 2:
        return []
    tips = [estimate.real(touch.T_world_tip, touch.jacobian) for touch in touches]
    beyond = [t.normal @ pose.apply(X, t.point[None])[0] - t.offset for t, X in zip(touches, tips, strict=True)]
    return [replace(t, offset=t.offset + float(np.mean(beyond))) for t in touches]
