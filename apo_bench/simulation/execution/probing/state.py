"""The calibration that a robot estimates by probing during one replay, and the commands that compensate for it.

The robot knows its commands, its encoders, the opening of the gripper, the wrench at its wrist, the plan, the part
files and the estimated poses of what is fixed. The drawn errors enter in two ways, as in every replay: they put the
hand where the robot does not expect it, and `estimated_tip` takes them off again, since it returns what the encoders
show.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from apo_bench.assembly import Plan, Touch
from apo_bench.geometry import Array, pose
from apo_bench.simulation.execution.flat_placement import FlatPlacement
from apo_bench.simulation.execution.probing.config import CalibrationEstimate, ProbingConfig
from apo_bench.simulation.execution.transfer import Grip
from apo_bench.simulation.robot import Robot, RobotError, WristSensor, get_wrist, zero
from apo_bench.simulation.scene import Scene

TOUCH_SIGMA_M = 3e-5
"""Standard deviation of a guarded touch of a plane, [m]."""
FOOT_SIGMA_M = 1e-4
"""Standard deviation of a foot of a part that was laid flat on the floor, [m]: pressed on, it sinks by as much."""
SQUARED = np.array([5e-5, 2e-4, 1e-3, 5e-3, 3e-3, 3e-3])
"""Standard deviations of a part between pads that closed twice, [m, rad], a twist of the tip: closing tips a
round part by 0.3 degrees, and pressed on a floor it slides up between the pads."""
_CORNERS = 3  # how often the touching corner of the hand is determined, as the estimate changes
_FLAT_M = 1e-5  # a patch that lies within this touched with its middle
_OFF_SIGMAS = 3.0  # how far the tip may be off, in standard deviations
_TOUCH_N = 2.0  # [N]: a touch ends by this force
_SIGMAS = 6.0  # or by so many standard deviations of the sensor at the wrist


def touch_guard(sigma_n: float) -> float:
    """The force that ends a touch, [N], of a sensor with this standard deviation, [N]."""
    return max(_TOUCH_N, _SIGMAS * sigma_n)


class ProbingState:
    """The state of a robot that probes, during one replay."""

    def __init__(self, probing: ProbingConfig, plan: Plan, scene: Scene, error: RobotError | None) -> None:
        none = np.eye(4)
        joints = np.zeros(len(scene.arm.joints))
        self.actions = probing.actions
        self.plan = plan
        self.estimate = probing.estimate
        self._config = probing
        self._wrist: WristSensor | None = None
        self._kinematics = scene.kinematics
        self._error = error or RobotError(none, joints, none, np.tile(none, (len(plan.assembly), 1, 1)))
        self.residual = self._error
        """The errors that remain after commands compensate for the estimate."""

    def begin(self, robot: Robot) -> None:
        """Zero the sensor at the wrist, in free air."""
        self._wrist = get_wrist(robot, self._config.ft_sensor, np.random.default_rng(self._config.seed))
        zero(robot, self._wrist)

    @property
    def wrist(self) -> WristSensor:
        assert self._wrist is not None, "begin first"
        return self._wrist

    @property
    def touch_n(self) -> float:
        """The force that ends a touch, [N]: well above what the sensor shows of nothing."""
        return touch_guard(self.wrist.sigma[0])

    def off_m(self, robot: Robot, T_world_tip: Array, direction: Array) -> float:
        """How far the tip may be off along a direction, (3,) world, [m]: three standard deviations of its estimate."""
        covariance = self.estimate.covariance_of(T_world_tip, self.jacobian(robot))[:3, :3]
        direction = T_world_tip[:3, :3].T @ direction
        return _OFF_SIGMAS * float(np.sqrt(direction @ covariance @ direction))

    def plane_by_camera(self, normal: Array, point: Array) -> tuple[Array, float]:
        """A plane of the frame that the arm takes for the world, by normal, (3,), and offset, [m], in the camera's."""
        back = pose.inverse(self.residual.hand_eye)
        n = back[:3, :3] @ normal
        return n, float(n @ (back[:3, :3] @ point + back[:3, 3]))

    def estimated_tip(self, robot: Robot) -> Array:
        """Where the robot would estimate its tip without compensation, (4, 4), world."""
        left = self.residual
        measured = self._kinematics.forward(robot.encoders())
        corrected = pose.inverse(left.hand_eye) @ measured @ pose.inverse(left.tool)
        return self.estimate.command(corrected, self.jacobian(robot))

    def jacobian(self, robot: Robot) -> Array:
        """The body Jacobian of the tip, (6, joints)."""
        return self._kinematics.jacobian(robot.q)

    def learn(self, robot: Robot, touches: Sequence[tuple[Touch, Array]], differ: bool = False) -> None:
        """Update the estimate by touches; from now on commands compensate for it.

        Args:
            touches: Touches of the hand, each with the corners of its patch, (k, 3), in the frame of the tip: of a hand
                that is estimated to be tilted the foremost corner touched.
            differ: Only what differs between the touches counts, which are of one wall: the fingers give way.
        """
        before = self.estimate
        for _ in range(_CORNERS):
            cornered = [self._cornered(touch, patch) for touch, patch in touches]
            self.estimate = before.touch(*(_less_common(before, cornered) if differ else cornered))
        left = self._error
        E = self.estimate.hand_eye
        tool = np.array(left.tool)
        tool[:3, 3] -= self.estimate.tool
        self.residual = replace(
            left, hand_eye=left.hand_eye @ pose.inverse(E), tool=tool, joints=left.joints - self.estimate.encoders
        )
        robot.compensate(self.residual.joints)

    def _cornered(self, touch: Touch, patch: Array) -> Touch:
        """The touch by the corner of the patch that is foremost as it is estimated."""
        ahead = pose.apply(self.estimate.real(touch.T_world_tip, touch.jacobian), patch) @ touch.normal
        flat = float(np.ptp(ahead)) < _FLAT_M
        return replace(touch, point=patch.mean(axis=0) if flat else patch[int(np.argmin(ahead))])

    def note_grasp(self, operation: int) -> None:
        """Note that a part was picked between pads that closed twice; it may have slipped since."""
        self.estimate = self.estimate.grasp(operation, np.hypot(self._config.slip, SQUARED))

    def T_tip_held(self, T_tip_part: Array) -> Array:
        """Where the arm takes a part to be in the frame of its tip, (4, 4), that is estimated at a pose in that of the
        real one."""
        return np.asarray(pose.inverse(self.residual.tool) @ T_tip_part)

    def foot(self, robot: Robot, operation: int, flat: FlatPlacement, T_tip_part: Array, foot: Array) -> Touch:
        """The touch of a foot of the held part that stands on the floor."""
        n, d = self.plane_by_camera(flat.normal, pose.apply(flat.T, flat.feet[:1])[0])
        return self.touch(robot, n, d, foot, (operation, T_tip_part), FOOT_SIGMA_M)

    def grip(self, operation: int, touches: Sequence[Touch], T_tip_part: Array, grip: Grip) -> Grip:
        """Update the estimate of how a part is held by its touches; returns the grip.

        The hand-eye error is not updated: what has been put down stands where it was put.

        Args:
            T_tip_part: Where it was estimated in the frame of the tip when it was taken, (4, 4).
        """
        self.estimate = self.estimate.touch(*touches)
        held = self.estimate.held(operation, T_tip_part)
        return Grip(pose.inverse(held) @ self.residual.tool, grip.half_width)

    def touch(
        self,
        robot: Robot,
        normal: Array,
        offset: float,
        point: Array,
        held: tuple[int, Array] | None = None,
        sigma_m: float = TOUCH_SIGMA_M,
    ) -> Touch:
        """The touch of a plane: the robot stands where it touched.

        Args:
            held: The grasp, and where the part is estimated in the frame of the tip, (4, 4); None of an empty hand.
        """
        J = self.jacobian(robot)
        grasp, T_tip_part = held or (None, None)
        return Touch(self.estimated_tip(robot), normal, offset, point, sigma_m, J, grasp, T_tip_part)


def _less_common(estimate: CalibrationEstimate, touches: Sequence[Touch]) -> list[Touch]:
    """Touches of one wall less what they have in common beyond what is estimated: their differences stay."""
    if len(touches) < 2:
        return []
    tips = [estimate.real(touch.T_world_tip, touch.jacobian) for touch in touches]
    beyond = [t.normal @ pose.apply(X, t.point[None])[0] - t.offset for t, X in zip(touches, tips, strict=True)]
    return [replace(t, offset=t.offset + float(np.mean(beyond))) for t in touches]
