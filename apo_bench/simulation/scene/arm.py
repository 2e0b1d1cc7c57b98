"""The arm as data, and its inverse kinematics by mink on a model of the arm alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import mink
import mujoco
import numpy as np

from apo_bench.errors import InputError, unknown
from apo_bench.geometry.arrays import Array, frozen
from apo_bench.geometry.records import copyable
from apo_bench.resources import folder


@final
@copyable
@dataclass(frozen=True, eq=False)
class Arm:
    """An arm with a parallel gripper; bring your own as `Arm(mjcf=..., tip=..., ...)`.

    The site `tip` lies between the fingertips: z points ahead, x along the closing direction.
    """

    mjcf: Path
    base: tuple[float, float, float]
    """Where its base stands, world, [m]."""
    joints: tuple[str, ...]
    """Each has a position actuator of the same name."""
    tip: str
    fingers: tuple[str, ...]
    """Slide joints, zero when closed, opening [m] per finger."""
    grip: str
    """The position actuator of the fingers."""
    mount: str
    """The body that a part is welded to by the ideal grasp."""
    home: Array
    """Joint angles near which inverse kinematics starts, [rad]."""
    opening_m: float
    """Widest opening per finger."""
    squeeze_m: float = 0.03
    """How far inside the part the fingers are commanded: beyond it the actuator's force limit rules."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "home", frozen(self.home, len(self.joints)))


def six_axis() -> Arm:
    """The arm that comes with the benchmark: six axes, spherical wrist, 94 mm gripper, 40 N."""
    return Arm(
        mjcf=folder("assets") / "arms" / "six_axis.xml",
        base=(-0.42, 0.0, 0.0),
        joints=("j1", "j2", "j3", "j4", "j5", "j6"),
        tip="tip",
        fingers=("left_finger", "right_finger"),
        grip="grip",
        mount="gripper",
        home=np.array([0.0, 0.2, 0.9, 0.0, 0.47, 0.0]),
        opening_m=0.046,
    )


_ARMS = {"six_axis": six_axis}


def find_arm(given: str | Arm) -> Arm:
    """An arm by short name, `module:name`, or as the object itself."""
    if isinstance(given, Arm):
        return given
    if ":" in given:
        from apo_bench.names import resolve

        made = resolve(given, {}, "arm")
        try:
            made = made() if callable(made) else made
        except Exception as error:
            raise InputError(
                f"the arm '{given}' failed: it raised {error!r}; give a function without arguments."
            ) from error
        if not isinstance(made, Arm):
            raise InputError(f"the arm '{given}' is a {type(made).__name__}; an `Arm`, or a function that returns one.")
        return made
    if given not in _ARMS:
        raise InputError(unknown("arm", given, _ARMS) + " Or give your own as 'package.module:name'.")
    return _ARMS[given]()


class Kinematics:
    """Forward and inverse kinematics of the arm alone."""

    POSITION_M = 1e-6
    ANGLE_RAD = 1e-5
    DAMPING = 1e-9
    GAIN = 0.95
    """A step takes at most this part of the way to a joint's limit."""

    def __init__(self, arm: Arm) -> None:
        spec = mujoco.MjSpec.from_file(str(arm.mjcf))
        spec.worldbody.first_body().pos = arm.base
        self.model = spec.compile()
        self.configuration = mink.Configuration(self.model)
        self.adr = np.array([int(self.model.jnt_qposadr[self.model.joint(j).id]) for j in arm.joints])
        self.tip = arm.tip
        self.site = self.model.site(arm.tip).id
        self._task = mink.FrameTask(arm.tip, "site", position_cost=1.0, orientation_cost=0.3)
        self._limits = [mink.ConfigurationLimit(self.model)]
        self._full = self.model.qpos0.copy()
        limited = self.model.jnt_limited.astype(np.bool_)
        self._range: Array = np.where(limited[:, None], self.model.jnt_range, (-np.inf, np.inf)).T

    def forward(self, q: Array) -> Array:
        """The pose of the tip, (4, 4), world."""
        self._full[self.adr] = q
        self.configuration.update(self._full)
        data = self.configuration.data
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = data.site_xmat[self.site].reshape(3, 3), data.site_xpos[self.site]
        return T

    def inverse(self, T: Array, near: Array, turns: int = 40) -> Array | None:
        """Joint angles that bring the tip to T, found by Newton steps from `near`; None if there are none there."""
        q = np.zeros(4)
        mujoco.mju_mat2Quat(q, np.ascontiguousarray(T[:3, :3]).ravel())
        self._task.set_target(mink.SE3(np.concatenate([q, T[:3, 3]])))
        self._full[self.adr] = near
        self.configuration.update(self._full)
        for _ in range(turns):
            error: Any = self._task.compute_error(self.configuration)
            off = error.tolist()
            if all(abs(x) < self.POSITION_M for x in off[:3]) and all(abs(x) < self.ANGLE_RAD for x in off[3:]):
                found = self.configuration.q[self.adr]
                return np.array(found)
            step = self._step()
            if step is None:
                return None
            longest = float(np.abs(step).max())
            self.configuration.integrate_inplace(step * min(1.0, 0.5 / max(longest, 1e-12)), 1.0)
        return None

    def _step(self) -> Array | None:
        """The step of all joints that mink's quadratic programme finds; None if it finds none.

        Without limits the programme is a linear system. Where its solution keeps them, it is that of the programme too.
        """
        H, c = self._task.compute_qp_objective(self.configuration)
        np.einsum("ii->i", H)[:] += self.DAMPING
        step: Array = np.linalg.solve(H, -c)
        low, high = self.GAIN * (self._range - self.configuration.q)
        if (step >= low).all() and (step <= high).all():
            return step
        try:
            found = mink.solve_ik(
                self.configuration, [self._task], 1.0, "daqp", damping=self.DAMPING, limits=self._limits
            )
        except mink.exceptions.MinkError:
            return None
        return np.asarray(found)
