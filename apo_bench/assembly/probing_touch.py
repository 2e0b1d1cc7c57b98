"""A touch of contact probing: a point of the hand, or of a held part, was measured to lie on a known plane."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from apo_bench.arguments import check_arguments
from apo_bench.errors import require
from apo_bench.geometry import FARTHEST_M, Array, copy_frozen, freeze, is_rigid, make_copyable

SMALLEST_SIGMA_M = 1e-9
"""Least allowed standard deviation of a touch, [m], so that rounding stays small against it."""
_NOT_UNIT = 1e-6
"""Largest deviation of the length of a normal from 1."""


@final
@check_arguments
@make_copyable
@dataclass(frozen=True, eq=False)
class Touch:
    """One touch: n . (X h v) = d, with X the true pose of the tip, h that of the part in the hand, v the point."""

    T_world_tip: Array
    """(4, 4): the pose of the tip that the robot assumed at the touch, [m]."""
    normal: Array
    """(3,): the unit normal n of the plane, world frame."""
    offset: float
    """d, [m]: the plane holds the points p with n . p = d."""
    point: Array
    """(3,), [m]: v, in the frame of the tip, or of the part that is held."""
    sigma_m: float
    """Standard deviation of the measured distance, [m]."""
    jacobian: Array | None = None
    """(6, joints): body Jacobian at `T_world_tip`, [m/rad, rad/rad]; None: the encoders count as exact."""
    grasp: int | None = None
    """The number of the grasp that held the part; None: the hand itself touched."""
    T_tip_part: Array | None = None
    """(4, 4): the assumed pose of the part in the frame of the tip, [m]; None: the identity."""

    def __post_init__(self) -> None:
        """Raises:
        InputError: A shape or number that is not allowed.
        """
        freeze(self, T_world_tip=(4, 4), normal=(3,), point=(3,), jacobian=(6, None), T_tip_part=(4, 4))
        require(
            self.grasp is not None or self.T_tip_part is None,
            "a touch with a part in the hand was given, but not its grasp; state the number of the grasp.",
        )
        checked_pose("pose of the tip", self.T_world_tip)
        checked_pose("pose of the part in the hand", np.eye(4) if self.T_tip_part is None else self.T_tip_part)
        length = float(np.linalg.norm(self.normal))
        require(
            abs(length - 1.0) <= _NOT_UNIT,
            f"a touch of a plane with a normal of length {length:.6g} was given; divide it by its length.",
        )
        require(np.isfinite(self.offset), f"a touch with {self.offset} as offset was given; give a finite number.")
        require(
            SMALLEST_SIGMA_M <= self.sigma_m <= FARTHEST_M,
            f"a touch with a sigma of {self.sigma_m:g} m was given; give one of {SMALLEST_SIGMA_M:g} m or more.",
        )


def checked_pose(name: str, value: Any) -> Array:
    """A read-only copy of a pose, (4, 4).

    Raises:
        InputError: It is not a rigid pose.
    """
    T = copy_frozen(value, 4, 4)
    require(is_rigid(T[None])[0], f"the {name} was given as a matrix that is no rigid pose; give a turn and a shift.")
    return T
