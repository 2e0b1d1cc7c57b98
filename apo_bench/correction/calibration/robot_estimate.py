"""The estimate of a robot's calibration errors from touches, its covariance, and the commands that make up for them."""

from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from apo_bench.arguments import check_arguments
from apo_bench.assembly import ProbingResult
from apo_bench.assembly.touch import Touch, checked_pose
from apo_bench.correction.calibration.robot_model import (
    HAND_EYE,
    TOOL,
    Places,
    compute_part_poses,
    grasp_in,
    hand_eye_displacement,
    joints_in,
    tip_displacement,
)
from apo_bench.correction.calibration.robust_estimate import NumberedTouch, robust_estimate
from apo_bench.errors import kind, require
from apo_bench.geometry import Array, copy_frozen, freeze, make_copyable, pose
from apo_bench.records.robot_error import Sigmas

UNKNOWN = Sigmas(hand_eye=(1.0, 0.2), joints_deg=0.05, tool_mm=0.5, in_hand=(0.5, 1.0))
"""[mm, deg], of a robot whose errors are not stated: a published automatic calibration of hand and eye ends at
0.93 mm and 0.27 degrees (arXiv 2311.01335)."""


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class RobotEstimate:
    """Mean and covariance of all unknowns of `robot_model`, after all touches so far."""

    middle: Array
    """(3,), [m], world frame: what a turn between hand and eye turns about."""
    joints: int
    grasps: tuple[int | None, ...]
    """The number of each grasp in the order in which they were made; None: another one has its number now."""
    sigmas: Array
    """(u,): prior standard deviations, [m, rad]."""
    mean: Array
    """(u,), [m, rad]."""
    covariance: Array
    """(u, u), to first order: with `UNKNOWN` regions of 95 % cover 95 % with touches of 20 um, and 92 % with those of
    5 um, where what the robot's errors make to second order is no longer small."""
    felt: tuple[NumberedTouch, ...] = ()
    """All touches so far, with the grasps that they are of."""
    taken: tuple[bool, ...] = ()
    """Which of them count."""

    def __post_init__(self) -> None:
        u = len(self.sigmas)
        freeze(self, middle=(3,), sigmas=(u,), mean=(u,), covariance=(u, u))

    @property
    def hand_eye(self) -> Array:
        """The estimated displacement from the world's frame of the robot to the true one, (4, 4), [m]."""
        return hand_eye_displacement(self.mean, self.middle)

    @property
    def tool(self) -> Array:
        """The estimated shift of the tip on the hand, (3,), in its own frame, [m]."""
        return self.mean[TOOL]

    @property
    def encoders(self) -> Array:
        """The estimated offset of each joint from its encoder, (joints,), [rad]."""
        return self.mean[joints_in(self.joints)]

    @property
    def touches(self) -> tuple[Touch, ...]:
        """Those that count."""
        return tuple(touch for (touch, _), counts in zip(self.felt, self.taken, strict=True) if counts)

    @property
    def refused(self) -> tuple[Touch, ...]:
        """Touches that contradict the others and the priors; they may count again after later ones."""
        return tuple(touch for (touch, _), counts in zip(self.felt, self.taken, strict=True) if not counts)

    @property
    def found(self) -> ProbingResult:
        """What has been found out, in short: how far hand and eye are apart, and how uncertain that is."""
        xi = self.mean[HAND_EYE]
        variances = self.covariance[HAND_EYE, HAND_EYE].diagonal()
        return ProbingResult(
            touches=len(self.touches),
            refused=len(self.refused),
            mm=float(1e3 * np.linalg.norm(pose.exp(xi)[:3, 3])),
            deg=float(np.degrees(np.linalg.norm(xi[3:]))),
            sure_mm=float(1e3 * np.sqrt(variances[:3].sum())),
            sure_deg=float(np.degrees(np.sqrt(variances[3:].sum()))),
        )

    def grasp(self, number: int, sigmas: ArrayLike) -> "RobotEstimate":
        """A part was grasped; a grasp of the same number is over, but its touches are kept.

        Args:
            sigmas: (6,): how far it may have moved in the hand, a twist in the frame of the tip, [m, rad]; 0 is exact.
        """
        new = _checked_sigmas(sigmas, 6)
        u = len(self.sigmas)
        covariance = np.zeros((u + 6, u + 6))
        covariance[:u, :u] = self.covariance
        covariance[u:, u:] = np.diag(new**2)
        over = tuple(None if one == number else one for one in self.grasps)
        return replace(
            self,
            grasps=(*over, number),
            sigmas=np.append(self.sigmas, new),
            mean=np.append(self.mean, np.zeros(6)),
            covariance=covariance,
        )

    def touch(self, *touches: Touch) -> "RobotEstimate":
        """Update the estimate by further touches, from all of them and the priors.

        Raises:
            InputError: No touch, one of a grasp that was not made, or with a Jacobian of other joints.
        """
        for touch in touches:
            require(isinstance(touch, Touch), f"{kind(touch)} was given as a touch; give each as a Touch: touch(a, b).")
            self._jacobian(touch.jacobian)
        felt = (*self.felt, *(NumberedTouch(touch, self._grasp(touch.grasp)) for touch in touches))
        mean, covariance, taken = robust_estimate(felt, self.sigmas, self.joints, self.middle)
        return replace(self, mean=mean, covariance=covariance, felt=felt, taken=tuple(taken.tolist()))

    def real(self, T_world_tip: ArrayLike, jacobian: ArrayLike | None = None) -> Array:
        """Where the tip really is, (4, 4), if the robot assumes it at `T_world_tip`, (4, 4), [m]."""
        B = checked_pose("pose of the tip", T_world_tip)
        offset = tip_displacement(self.mean, self._jacobian(jacobian))
        return hand_eye_displacement(self.mean, self.middle) @ B @ offset

    def command(self, T_world_tip: ArrayLike, jacobian: ArrayLike | None = None) -> Array:
        """The pose of the tip to command, (4, 4), so that it really comes to `T_world_tip`; inverse of `real`."""
        X = checked_pose("pose of the tip", T_world_tip)
        offset = tip_displacement(self.mean, self._jacobian(jacobian))
        return pose.inverse(hand_eye_displacement(self.mean, self.middle)) @ X @ pose.inverse(offset)

    def held(self, grasp: int, T_tip_part: ArrayLike) -> Array:
        """Where a part really lies in the frame of the tip, (4, 4), that the robot assumes at `T_tip_part`, (4, 4)."""
        gamma = self.mean[grasp_in(self.joints, self._grasp(grasp))]
        return pose.exp(gamma) @ checked_pose("pose of the part in the hand", T_tip_part)

    def goal_tip(
        self, T_world_part: ArrayLike, grasp: int, T_tip_part: ArrayLike, jacobian: ArrayLike | None = None
    ) -> Array:
        """The pose of the tip to command, (4, 4), so that a part that is held really comes to `T_world_part`."""
        goal = checked_pose("goal of the part", T_world_part)
        return self.command(goal @ pose.inverse(self.held(grasp, T_tip_part)), jacobian)

    def jacobian_of(
        self,
        T_world_tip: ArrayLike,
        jacobian: ArrayLike | None = None,
        grasp: int | None = None,
        T_tip_part: ArrayLike | None = None,
    ) -> Array:
        """How the body twist of the held part, or of the tip, depends on the unknowns, (6, u), at this command.

        The covariance of the difference of two places is (D - D') `covariance` (D - D')^t, with twists in one frame.
        """
        B = checked_pose("pose of the tip", T_world_tip)
        held = checked_pose("pose of the part in the hand", np.eye(4) if T_tip_part is None else T_tip_part)
        place = Places(B[None], self._jacobian(jacobian)[None], held[None], np.array([self._grasp(grasp)]))
        return compute_part_poses(self.mean, self.middle, place)[1][0]

    def covariance_of(
        self,
        T_world_tip: ArrayLike,
        jacobian: ArrayLike | None = None,
        grasp: int | None = None,
        T_tip_part: ArrayLike | None = None,
    ) -> Array:
        """How uncertain is where the held part, or the tip, really comes to be: (6, 6) of its body twist, [m, rad]."""
        D = self.jacobian_of(T_world_tip, jacobian, grasp, T_tip_part)
        return D @ self.covariance @ D.T

    def _grasp(self, number: int | None) -> int:
        """Which of the grasps that were made has a number now; -1 for the empty hand."""
        if number is None:
            return -1
        made = ", ".join(str(one) for one in self.grasps if one is not None) or "none"
        require(number in self.grasps, f"grasp {number} was given; grasps so far: {made}; call `grasp` first.")
        return self.grasps.index(number)

    def _jacobian(self, jacobian: ArrayLike | None) -> Array:
        """(6, joints): zeros if none was given."""
        return np.zeros((6, self.joints)) if jacobian is None else copy_frozen(jacobian, 6, self.joints)


@check_arguments
def make_prior_estimate(sigmas: Sigmas, joints: int, middle: ArrayLike) -> RobotEstimate:
    """The estimate before the first touch: no error, with the stated standard deviations.

    Args:
        sigmas: Standard deviations, [mm] and [deg]; `UNKNOWN` where they are not stated.
        joints: How many joints the arm has.
        middle: (3,), [m], world frame: the mean of the poses.
    """
    require(joints >= 0, f"{joints} joints were given; give the number of joints of the arm.")
    mm, deg = sigmas.hand_eye
    prior = np.zeros(joints_in(joints).stop)
    prior[HAND_EYE] = np.repeat([1e-3 * mm, np.radians(deg)], 3)
    prior[TOOL] = 1e-3 * sigmas.tool_mm
    prior[joints_in(joints)] = np.radians(sigmas.joints_deg)
    checked = _checked_sigmas(prior, len(prior))
    return RobotEstimate(copy_frozen(middle, 3), joints, (), checked, np.zeros(len(checked)), np.diag(checked**2))


def compute_slip_sigmas(sigmas: Sigmas) -> Array:
    """How far a part may slip in the hand, (6,), [m, rad]: along the pads, y and z of the tip, and about x."""
    mm, deg = sigmas.in_hand
    return np.array([0.0, 1e-3 * mm, 1e-3 * mm, np.radians(deg), 0.0, 0.0])


def _checked_sigmas(sigmas: ArrayLike, n: int) -> Array:
    checked = copy_frozen(sigmas, n)
    require((checked >= 0.0).all(), f"a standard deviation of {checked.min():g} was given; 0 or more is allowed.")
    return checked
