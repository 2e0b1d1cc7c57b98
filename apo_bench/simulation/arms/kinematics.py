"""Forward and inverse kinematics of an arm by mink, on a model of the arm alone."""

from typing import Any

import mink
import mujoco
import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.loading import load_model
from apo_bench.simulation.frames import frame, quaternion


class Kinematics:
    """Forward and inverse kinematics of the arm alone."""

    POSITION_M = 1e-6
    ANGLE_RAD = 1e-5
    DAMPING = 1e-9
    GAIN = 0.95
    """A step takes at most this part of the way to a joint's limit."""

    LEAN_RAD = 0.035
    LEANING = 1e-3
    """An arm of five joints holds the tip at its place, turned as near as it can: so much off at most, by this cost."""

    POSTURE = 2e-4
    """How much an arm with more than six joints prefers its home, as a cost: the tip is off by some 1e-8 m for it."""

    def __init__(self, arm: Arm, posture: bool = True) -> None:
        self.arm = arm
        self.model = _alone(arm)
        self.configuration = mink.Configuration(self.model)
        self.ids = [int(self.model.joint(j).id) for j in arm.joints]
        self.adr = self.model.jnt_qposadr[self.ids]
        self.site = self.model.site(arm.tip).id
        self._leans = len(arm.joints) < 6
        turning = self.LEANING if self._leans else 0.3
        self._task = mink.FrameTask(arm.tip, "site", position_cost=1.0, orientation_cost=turning)
        self._cost: Array = self._task.cost[:, None]
        self._damping: Array = self.DAMPING * np.eye(self.model.nv)
        self._J: Array = np.zeros((2, 3, self.model.nv))
        self._turned: Array = np.zeros(4)
        self._limits = [mink.ConfigurationLimit(self.model)]
        self._full = self.model.qpos0.copy()
        limited = self.model.jnt_limited.astype(np.bool_)
        self._range: Array = np.where(limited[:, None], self.model.jnt_range, (-np.inf, np.inf)).T
        self._posture: Any = None
        if posture:
            self.keep_near(arm.home)

    def keep_near(self, home: Array) -> None:
        """Of arms with more than six joints: which joint angles they prefer from now on, [rad]."""
        if len(self.adr) <= 6:
            return
        cost = np.zeros(self.model.nv)
        cost[self.model.jnt_dofadr[self.ids]] = self.POSTURE
        self._posture = mink.PostureTask(self.model, cost=cost)
        q = self.model.qpos0.copy()
        q[self.adr] = home
        self._posture.set_target(q)

    @property
    def first_link(self) -> str:
        """The first body of the arm that moves: everything that moves hangs on it."""
        tree = self.model.body_treeid[self.model.body(self.arm.mount).id]
        return str(self.model.body(int(self.model.tree_bodyadr[tree])).name)

    @property
    def joint_range(self) -> Array:
        """(2, joints): the lowest and the highest angle of each, [rad]."""
        return self._range[:, self.ids]

    def limit_margins(self, q: Array) -> Array:
        """How far each joint is from its nearer limit, (joints,), [rad]."""
        low, high = self.joint_range
        return np.asarray(np.minimum(q - low, high - q))

    @property
    def last(self) -> Array:
        """Where the last search for joint angles ended, or the angles of the last call, (joints,), [rad]."""
        return np.array(self.configuration.q[self.adr])

    def forward(self, q: Array) -> Array:
        """The pose of the tip, (4, 4), world."""
        data = self.configuration.data
        self._full[self.adr] = q
        data.qpos[:] = self._full
        mujoco.mj_kinematics(self.model, data)
        return frame(data.site_xmat[self.site], data.site_xpos[self.site])

    def jacobian(self, q: Array) -> Array:
        """The body Jacobian of the tip, (6, joints): its twist in its own frame, [m, rad], per radian of each joint."""
        self.forward(q)
        return self._jacobian()[:, self.model.jnt_dofadr[self.ids]]

    def inverse_jacobian(self, q: Array) -> Array:
        """How the joints turn with the tip, (joints, 6), [rad] per [m, rad] of a twist in its own frame.

        An arm of five joints keeps the place of the tip before its turn, as `inverse` does.
        """
        return np.asarray(np.linalg.pinv(self._cost * self.jacobian(q)) * self._cost[:, 0])

    def _jacobian(self) -> Array:
        """The body Jacobian of the tip where `mj_kinematics` found it, (6, all joints of the model)."""
        data = self.configuration.data
        mujoco.mj_comPos(self.model, data)
        mujoco.mj_jacSite(self.model, data, self._J[0], self._J[1], self.site)
        return np.asarray((data.site_xmat[self.site].reshape(3, 3).T @ self._J).reshape(6, -1))

    def inverse(self, T: Array, near: Array, turns: int = 40) -> Array | None:
        """Joint angles that bring the tip to T, found by Newton steps from `near`; None if there are none there.

        The turn about one axis is left to an arm of five joints, within `LEAN_RAD`.
        """
        data = self.configuration.data
        target = quaternion(T)
        self._full[self.adr] = near
        data.qpos[:] = self._full
        for _ in range(turns):
            mujoco.mj_kinematics(self.model, data)
            error = self._error(T[:3, 3], target)
            off = error.tolist()
            if all(abs(x) < self.POSITION_M for x in off[:3]) and all(abs(x) < self.ANGLE_RAD for x in off[3:]):
                return self.last
            step = self._step(error, T)
            if step is None:
                return None
            longest = float(np.abs(step).max())
            if self._leans and max(map(abs, off[:3])) < self.POSITION_M and longest < self.ANGLE_RAD:
                return self.last if max(map(abs, off[3:])) < self.LEAN_RAD else None
            # No joint turns by more than half a radian in one step: far from the target the linearisation is wrong.
            mujoco.mj_integratePos(self.model, data.qpos, step, min(1.0, 0.5 / max(longest, 1e-12)))
        return None

    def _error(self, position: Array, turned: Array) -> Array:
        """How far the tip is from a place, (3,), and from a quaternion: (6,), in its own frame, [m] and [rad]."""
        data = self.configuration.data
        error = np.empty(6)
        error[:3] = (position - data.site_xpos[self.site]) @ data.site_xmat[self.site].reshape(3, 3)
        mujoco.mju_mat2Quat(self._turned, data.site_xmat[self.site])
        mujoco.mju_subQuat(error[3:], turned, self._turned)
        return error

    def _step(self, error: Array, T: Array) -> Array | None:
        """The step of all joints towards T; None if there is none.

        mink's quadratic programme without limits is a linear system. Where its solution keeps them, it is that of the
        programme too.
        """
        # The least of 1/2 s^T H s - c^T s with H = J^T W J and c = J^T W error: without limits H s = c. A little
        # damping on the diagonal keeps H regular where the arm is straight.
        J = self._cost * self._jacobian()
        H = J.T @ J + self._damping
        c = (self._cost[:, 0] * error) @ J
        if self._posture is not None:
            more = self._posture.compute_qp_objective(self.configuration)
            H = H + more[0]
            c = c - more[1]
        step: Any = np.linalg.solve(H, c)
        low, high = self.GAIN * (self._range - self.configuration.data.qpos)
        if (step >= low).all() and (step <= high).all():
            return step
        self._task.set_target(mink.SE3(np.concatenate([quaternion(T), T[:3, 3]])))
        try:
            tasks = [self._task] if self._posture is None else [self._task, self._posture]
            limited = mink.solve_ik(self.configuration, tasks, 1.0, "daqp", damping=self.DAMPING, limits=self._limits)
        except mink.exceptions.MinkError:
            return None
        return np.asarray(limited)


def _alone(arm: Arm) -> Any:
    """The model of the arm where it stands, and nothing else."""
    spec = mujoco.MjSpec.from_string(arm.model) if arm.model is not None else load_model(arm.mjcf, "arm")
    stand = pose.unpack(np.array([*arm.base, *arm.turn]))
    for body in spec.worldbody.bodies:
        T = pose.pack(stand @ pose.unpack(np.array([*body.pos, *body.quat])))
        body.pos = T[:3]
        body.quat = T[3:]
    return spec.compile()
