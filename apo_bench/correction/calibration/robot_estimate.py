"""Estimate of a robot's calibration errors from touches, with covariance, and commands that compensate for them."""

from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from apo_bench.arguments import check_arguments
from apo_bench.assembly import ProbingResult
from apo_bench.assembly.probing_touch import Touch, checked_pose
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

UNKNOWN = Sigmas(
    hand_eye=(1.0, 0.2), joints_deg=0.05, tool_mm=0.5, in_hand=(0.5, 1.0), sag_mm=0.5, base_tilt_deg=0.1, finger_mm=0.5
)
"""Standard deviations for a robot whose errors are not stated, [mm, deg]. A published automatic calibration of hand and
eye ends at 0.93 mm and 0.27 degrees (arXiv 2311.01335)."""


@final
@make_copyable
@dataclass(frozen=True, eq=False)
class RobotEstimate:
    """Mean and covariance of the u unknowns of `robot_model`, given all touches so far."""

    middle: Array
    """(3,), [m], world frame: the centre of the rotation between hand and eye."""
    joints: int
    """Number of columns of a Jacobian: the joints of the arm, and its sag if that is stated."""
    grasps: tuple[int | None, ...]
    """The number of each grasp in order; None for a grasp that is over since another one has its number."""
    sigmas: Array
    """(u,): prior standard deviations, [m, rad]."""
    mean: Array
    """(u,), [m, rad]."""
    covariance: Array
    """(u, u), to first order. With `UNKNOWN`, regions of 95 % cover 95 % with touches of 20 um, and 92 % with those of
    5 um, where second-order effects of the robot's errors are no longer small."""
    felt: tuple[NumberedTouch, ...] = ()
    """All touches so far, each with the index of its grasp."""
    taken: tuple[bool, ...] = ()
    """Which of the touches are used."""
    sags: bool = False
    """Whether the last column of a Jacobian is the displacement of the tip by a sag of 1 m, as a body twist."""

    def __post_init__(self) -> None:
        u = len(self.sigmas)
        freeze(self, middle=(3,), sigmas=(u,), mean=(u,), covariance=(u, u))

    @property
    def hand_eye(self) -> Array:
        """The estimated displacement from the assumed world frame of the robot to the true one, (4, 4), [m]."""
        return hand_eye_displacement(self.mean, self.middle)

    @property
    def tool(self) -> Array:
        """The estimated offset of the tip, (3,), in its own frame, [m]."""
        return self.mean[TOOL]

    @property
    def encoders(self) -> Array:
        """The estimated offset of each joint from its encoder, (joints,), [rad], without the sag."""
        return self.mean[joints_in(self.joints)][: self.joints - self.sags]

    @property
    def sag(self) -> float:
        """The estimated height that the tip loses by the weight of the arm, [m]; 0 if no sag is stated."""
        return float(self.mean[joints_in(self.joints)][-1]) if self.sags else 0.0

    @property
    def touches(self) -> tuple[Touch, ...]:
        """The touches that are used."""
        return tuple(touch for (touch, _), counts in zip(self.felt, self.taken, strict=True) if counts)

    @property
    def refused(self) -> tuple[Touch, ...]:
        """Touches that contradict the others and the priors; later touches may make them count again."""
        return tuple(touch for (touch, _), counts in zip(self.felt, self.taken, strict=True) if not counts)

    @property
    def found(self) -> ProbingResult:
        """Summary: estimated hand-eye displacement, its uncertainty, and numbers of touches."""
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
        """Add the unknowns of a new grasp; an earlier grasp of the same number is over, but its touches are kept.

        Args:
            sigmas: (6,): standard deviations of the slip in the hand, a twist in the frame of the tip, [m, rad]; 0 is
                exact.
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
        """Update the estimate by further touches; it is computed from all touches and the priors.

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
        """The true pose of the tip, (4, 4), if the robot assumes it at `T_world_tip`, (4, 4), [m]."""
        B = checked_pose("pose of the tip", T_world_tip)
        offset = tip_displacement(self.mean, self._jacobian(jacobian))
        return hand_eye_displacement(self.mean, self.middle) @ B @ offset

    def command(self, T_world_tip: ArrayLike, jacobian: ArrayLike | None = None) -> Array:
        """The pose of the tip to command, (4, 4), so that its true pose is `T_world_tip`; inverse of `real`."""
        X = checked_pose("pose of the tip", T_world_tip)
        offset = tip_displacement(self.mean, self._jacobian(jacobian))
        return pose.inverse(hand_eye_displacement(self.mean, self.middle)) @ X @ pose.inverse(offset)

    def held(self, grasp: int, T_tip_part: ArrayLike) -> Array:
        """The true pose of a held part in the frame of the tip, (4, 4), if the robot assumes it at `T_tip_part`, (4,
        4).
        """
        gamma = self.mean[grasp_in(self.joints, self._grasp(grasp))]
        return pose.exp(gamma) @ checked_pose("pose of the part in the hand", T_tip_part)

    def goal_tip(
        self, T_world_part: ArrayLike, grasp: int, T_tip_part: ArrayLike, jacobian: ArrayLike | None = None
    ) -> Array:
        """The pose of the tip to command, (4, 4), so that the true pose of a held part is `T_world_part`."""
        goal = checked_pose("goal of the part", T_world_part)
        return self.command(goal @ pose.inverse(self.held(grasp, T_tip_part)), jacobian)

    def jacobian_of(
        self,
        T_world_tip: ArrayLike,
        jacobian: ArrayLike | None = None,
        grasp: int | None = None,
        T_tip_part: ArrayLike | None = None,
    ) -> Array:
        """The derivative of the body twist of the held part, or of the tip, by the unknowns, (6, u), at this command.

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
        """The covariance of the true pose of the held part, or of the tip: (6, 6) of its body twist, [m, rad]."""
        D = self.jacobian_of(T_world_tip, jacobian, grasp, T_tip_part)
        return D @ self.covariance @ D.T

    def _grasp(self, number: int | None) -> int:
        """The index in `grasps` of a grasp number; -1 for the empty hand (None)."""
        if number is None:
            return -1
        made = ", ".join(str(one) for one in self.grasps if one is not None) or "none"
        require(number in self.grasps, f"grasp {number} was given; grasps so far: {made}; call `grasp` first.")
        return self.grasps.index(number)

    def _jacobian(self, jacobian: ArrayLike | None) -> Array:
        """The checked Jacobian, (6, joints); zeros if None."""
        return np.zeros((6, self.joints)) if jacobian is None else copy_frozen(jacobian, 6, self.joints)


@check_arguments
def make_prior_estimate(
    sigmas: Sigmas, joints: int, middle: ArrayLike, base: ArrayLike | None = None, sags: bool = False
) -> RobotEstimate:
    """The estimate before any touch: all errors 0, with the stated standard deviations.

    Args:
        sigmas: Standard deviations, [mm] and [deg]; `UNKNOWN` where they are not stated.
        joints: Number of joints of the arm.
        middle: (3,), [m], world frame: the mean of the poses.
        base: (3,), [m], world frame: the foot of the robot, about which it tilts; None leaves the tilt out.
        sags: Whether Jacobians of touches have a further column, the displacement of the tip by a sag of 1 m.
    """
    require(joints >= 0, f"{joints} joints were given; give the number of joints of the arm.")
    mm, deg = sigmas.hand_eye
    prior = np.zeros(joints_in(joints).stop)
    prior[HAND_EYE] = np.repeat([1e-3 * mm, np.radians(deg)], 3)
    center = copy_frozen(middle, 3)
    if base is not None and sigmas.base_tilt_deg:
        # Turns about the level axes move the middle by w x arm. The estimate takes shift and turn as independent.
        x, y, z = center - copy_frozen(base, 3)
        tilt = np.radians(sigmas.base_tilt_deg)
        prior[HAND_EYE] = np.hypot(prior[HAND_EYE], tilt * np.array([z, z, np.hypot(x, y), 1.0, 1.0, 0.0]))
    prior[TOOL] = 1e-3 * sigmas.tool_mm
    prior[joints_in(joints)] = np.radians(sigmas.joints_deg)
    if sags:
        prior = np.append(prior, 1e-3 * sigmas.sag_mm)
    checked = _checked_sigmas(prior, len(prior))
    mean = np.zeros(len(checked))
    return RobotEstimate(center, joints + sags, (), checked, mean, np.diag(checked**2), sags=sags)


def compute_slip_sigmas(sigmas: Sigmas) -> Array:
    """Standard deviations of the slip of a part in the hand, (6,), [m, rad]: along y and z of the tip, and about x."""
    mm, deg = sigmas.in_hand
    return np.array([0.0, 1e-3 * mm, 1e-3 * mm, np.radians(deg), 0.0, 0.0])


def _checked_sigmas(sigmas: ArrayLike, n: int) -> Array:
    """A read-only copy of n standard deviations, none of them negative."""
    checked = copy_frozen(sigmas, n)
    require((checked >= 0.0).all(), f"a standard deviation of {checked.min():g} was given; 0 or more is allowed.")
    return checked
