"""What a robot that feels knows in the course of one replay: its belief, its wrist, and which plan that makes.

It knows commands, encoders, the opening, the wrench at its wrist, the plan, the files of parts and where what is fixed
is believed to be. The drawn errors enter in two ways, as in every replay: they put the hand where it does not believe
it to be, and `believed_tip` takes them off again, since what it tells is what the robot's own encoders say.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol, final

import numpy as np

from apo_bench.assembly import Plan, ProbingResult, Touch
from apo_bench.geometry import Array, pose
from apo_bench.records import USUAL_FT_SENSOR
from apo_bench.simulation.execution.beside import Flush
from apo_bench.simulation.execution.transfer import Grip
from apo_bench.simulation.robot import Robot, RobotError, WristSensor, wrist_of, zero
from apo_bench.simulation.scene import Scene

ACTS = ("square", "touch", "lay", "search")
"""Parts are squared before they are taken, what is fixed is touched, what is inserted is laid flat first (and touches a
wall, if it comes from above), and what is stopped all the same is searched for."""
TOUCH_SIGMA_M = 3e-5
"""How exactly a guarded touch tells a plane, [m]."""
FOOT_SIGMA_M = 1e-4
"""How exactly a foot of a part that was laid flat stands on the floor, [m]: pressed on, it sinks by as much."""
SQUARED = np.array([5e-5, 2e-4, 1e-3, 5e-3, 3e-3, 3e-3])
"""How exactly a part lies between pads that closed twice, [m, rad], a twist in the frame of the tip: closing tips a
round part by 0.3 degrees, and pressed on a floor it slides up between the pads."""
_CORNERS = 3
_FLAT_M = 1e-5
"""Which corner of the hand touched is asked so often, as what is believed changes; a patch that lies within the second
touched with its middle."""
_OFF_SIGMAS = 3.0
_TOUCH_N = 2.0
_SIGMAS = 6.0
"""A touch ends by this force, or by so many standard deviations of what the wrist feels."""


def touch_guard(sigma_n: float) -> float:
    """The force that ends a touch, [N], of a wrist that feels with this standard deviation, [N]."""
    return max(_TOUCH_N, _SIGMAS * sigma_n)


class Belief(Protocol):
    """What a robot believes of itself, and how it learns: `apo_bench.correction.calibration` has one."""

    @property
    def hand_eye(self) -> Array:
        """Where the robot goes, (4, 4), for what it takes to be the frame of the world."""
        ...

    @property
    def tool(self) -> Array:
        """How far the tip is off on the hand, (3,), in its own frame, [m]."""
        ...

    @property
    def encoders(self) -> Array:
        """How far each joint is off what its encoder says, (joints,), [rad]."""
        ...

    @property
    def found(self) -> ProbingResult:
        """What has been found out."""
        ...

    def grasp(self, number: int, sigmas: Array) -> "Belief":
        """A part was grasped, which may have moved in the hand by so much, (6,), [m, rad]."""
        ...

    def touch(self, *touches: Touch) -> "Belief":
        """Learn from touches."""
        ...

    def real(self, T_world_tip: Array, jacobian: Array | None) -> Array:
        """Where the tip really is, (4, 4)."""
        ...

    def command(self, T_world_tip: Array, jacobian: Array | None) -> Array:
        """The inverse of `real`."""
        ...

    def covariance_of(self, T_world_tip: Array, jacobian: Array | None) -> Array:
        """How uncertain is where the tip really is, (6, 6), of its body twist."""
        ...

    def held(self, grasp: int, T_tip_part: Array) -> Array:
        """Where a part lies in the frame of the tip, (4, 4)."""
        ...


@final
@dataclass(frozen=True, eq=False)
class ProbingConfig:
    """How a robot feels."""

    belief: Belief
    """Before anything is touched."""
    slip: Array
    """(6,): how far a part may slip in the hand, standard deviations of a twist in the frame of the tip, [m, rad]."""
    seed: tuple[int, ...]
    """Of the noise of its sensor."""
    wrench: str = USUAL_FT_SENSOR
    """The sensor at its wrist, as in `wrench_noise`."""
    acts: tuple[str, ...] = ACTS
    """What it does besides."""


class ProbingState:
    """The state of a robot that feels, during one replay."""

    def __init__(self, probing: ProbingConfig, plan: Plan, scene: Scene, error: RobotError | None) -> None:
        none = np.eye(4)
        joints = np.zeros(len(scene.arm.joints))
        self.acts = probing.acts
        self.plan = plan
        self.belief = probing.belief
        self._feels = probing
        self._wrist: WristSensor | None = None
        self._kinematics = scene.kinematics
        self._error = error or RobotError(none, joints, none, np.tile(none, (len(plan.assembly), 1, 1)))
        self.residual = self._error
        """What is still wrong once commands make up for what is believed."""

    def begin(self, robot: Robot) -> None:
        """Zero the sensor at the wrist, in free air."""
        self._wrist = wrist_of(robot, self._feels.wrench, np.random.default_rng(self._feels.seed))
        zero(robot, self._wrist)

    @property
    def wrist(self) -> WristSensor:
        assert self._wrist is not None, "begin first"
        return self._wrist

    @property
    def touch_n(self) -> float:
        """The force that ends a touch, [N]: well above what the sensor shows of nothing."""
        return touch_guard(self.wrist.sigma[0])

    def off_m(self, robot: Robot, T_world_tip: Array, way: Array) -> float:
        """How far the tip may be off along a direction, (3,) world, [m]: three standard deviations of its belief."""
        covariance = self.belief.covariance_of(T_world_tip, self.jacobian(robot))[:3, :3]
        way = T_world_tip[:3, :3].T @ way
        return _OFF_SIGMAS * float(np.sqrt(way @ covariance @ way))

    def is_uncorrected(self, normal: Array, point: Array) -> tuple[Array, float]:
        """Normal and offset of a plane, (3,) and [m], in the world as the eye has it, from where the arm takes it."""
        back = pose.inverse(self.residual.hand_eye)
        n = back[:3, :3] @ normal
        return n, float(n @ (back[:3, :3] @ point + back[:3, 3]))

    def believed_tip(self, robot: Robot) -> Array:
        """Where the robot would believe its tip if it made up for nothing, (4, 4), world."""
        left = self.residual
        measured = self._kinematics.forward(robot.encoders())
        corrected = pose.inverse(left.hand_eye) @ measured @ pose.inverse(left.tool)
        return self.belief.command(corrected, self.jacobian(robot))

    def jacobian(self, robot: Robot) -> Array:
        """The body Jacobian of the tip, (6, joints)."""
        return self._kinematics.jacobian(robot.q)

    def learn(self, robot: Robot, felt: Sequence[tuple[Touch, Array]], differ: bool = False) -> None:
        """Believe what was felt; from now on commands make up for it.

        Args:
            felt: Touches of the hand, each with the corners of its patch, (k, 3), in the frame of the tip: of a hand
                that is believed to be tilted the foremost corner touched.
            differ: Only what differs between the touches counts, which are of one wall: the fingers give way.
        """
        before = self.belief
        for _ in range(_CORNERS):
            touches = [self._cornered(touch, patch) for touch, patch in felt]
            self.belief = before.touch(*(_less_common(before, touches) if differ else touches))
        left = self._error
        E = self.belief.hand_eye
        tool = np.array(left.tool)
        tool[:3, 3] -= self.belief.tool
        self.residual = replace(
            left, hand_eye=left.hand_eye @ pose.inverse(E), tool=tool, joints=left.joints - self.belief.encoders
        )
        robot.compensate(self.residual.joints)

    def _cornered(self, touch: Touch, patch: Array) -> Touch:
        """The touch by the corner of the patch that is foremost as it is believed."""
        ahead = pose.apply(self.belief.real(touch.T_world_tip, touch.jacobian), patch) @ touch.normal
        flat = float(np.ptp(ahead)) < _FLAT_M
        return replace(touch, point=patch.mean(axis=0) if flat else patch[int(np.argmin(ahead))])

    def taken(self, operation: int) -> None:
        """A part was taken between pads that closed twice; it may have slipped since."""
        self.belief = self.belief.grasp(operation, np.hypot(self._feels.slip, SQUARED))

    def T_tip_held(self, T_tip_part: Array) -> Array:
        """Where the arm takes a part to be in the frame of its tip, (4, 4), that is believed at a pose in that of the
        real one."""
        return np.asarray(pose.inverse(self.residual.tool) @ T_tip_part)

    def foot(self, robot: Robot, operation: int, flush: Flush, T_tip_part: Array, foot: Array) -> Touch:
        """What a foot of the held part tells that stands on the floor."""
        n, d = self.is_uncorrected(flush.normal, pose.apply(flush.T, flush.feet[:1])[0])
        return self.touch(robot, n, d, foot, (operation, T_tip_part), FOOT_SIGMA_M)

    def grip(self, operation: int, touches: Sequence[Touch], T_tip_part: Array, grip: Grip) -> Grip:
        """How a part is believed to be held after what it told that touched.

        What hand and eye are off is not believed anew: what has been put down stands where it was put.

        Args:
            T_tip_part: Where it was believed in the frame of the tip when it was taken, (4, 4).
        """
        self.belief = self.belief.touch(*touches)
        held = self.belief.held(operation, T_tip_part)
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
        """What touching a plane tells: the robot stands where it felt it.

        Args:
            held: The grasp, and where the part is believed in the frame of the tip, (4, 4); None of an empty hand.
        """
        J = self.jacobian(robot)
        grasp, T_tip_part = held or (None, None)
        return Touch(self.believed_tip(robot), normal, offset, point, sigma_m, J, grasp, T_tip_part)


def _less_common(belief: Belief, touches: Sequence[Touch]) -> list[Touch]:
    """Touches of one wall less what they have in common beyond what is believed: their differences stay."""
    if len(touches) < 2:
        return []
    tips = [belief.real(touch.T_world_tip, touch.jacobian) for touch in touches]
    beyond = [t.normal @ pose.apply(X, t.point[None])[0] - t.offset for t, X in zip(touches, tips, strict=True)]
    return [replace(t, offset=t.offset + float(np.mean(beyond))) for t in touches]
