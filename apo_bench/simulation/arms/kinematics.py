"""Forward and inverse kinematics of an arm, with mink, on a model of the arm alone."""

from typing import Any

import mink
import mujoco
import numpy as np
from scipy.linalg.lapack import dgesv

from apo_bench.geometry import Array, pose
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.loading import load_model
from apo_bench.simulation.frames import frame, quaternion


class Kinematics:
    """Forward and inverse kinematics of the arm alone."""

    POSITION_M = 1e-6  # tolerance of a solution
    ANGLE_RAD = 1e-5  # tolerance of a solution
    DAMPING = 1e-9
    GAIN = 0.95
    """Largest share of the distance to a joint's limit in one step."""

    LEAN_RAD = 0.035
    """Largest rotation error of an arm of five joints, which cannot reach all orientations."""
    LEANING = 1e-3
    """Cost of that rotation error, against 1 for the position."""

    POSTURE = 2e-4
    """Cost of the distance from home for an arm with more than six joints; it moves the tip by about 1e-8 m."""

    def __init__(self, arm: Arm, posture: bool = True) -> None:
        """Build the model of an arm alone.

        Args:
            posture: Whether an arm with more than six joints prefers its home.
        """
        self.arm = arm
        self.model = _alone(arm)
        self.configuration = mink.Configuration(self.model)
        self.ids = [int(self.model.joint(j).id) for j in arm.joints]
        self.adr = self.model.jnt_qposadr[self.ids]
        self.site = self.model.site(arm.tip).id
        self._leans = len(arm.joints) < 6
        turning = self.LEANING if self._leans else 0.3  # cost of the rotation error
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
        """Set the joint angles, [rad], that an arm with more than six joints prefers from now on."""
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
        """The first moving body of the arm; all other moving bodies descend from it."""
        tree = self.model.body_treeid[self.model.body(self.arm.mount).id]
        return str(self.model.body(int(self.model.tree_bodyadr[tree])).name)

    @property
    def joint_range(self) -> Array:
        """(2, joints): the lowest and the highest angle of each, [rad]."""
        return self._range[:, self.ids]

    def limit_margins(self, q: Array) -> Array:
        """Distance of each joint from its nearer limit, (joints,), [rad]."""
        low, high = self.joint_range
        return np.asarray(np.minimum(q - low, high - q))

    @property
    def last(self) -> Array:
        """The joint angles at the end of the last call, also of a search that failed, (joints,), [rad]."""
        return np.array(self.configuration.q[self.adr])

    def forward(self, q: Array) -> Array:
        """The pose of the tip, (4, 4), world frame, at joint angles q, (joints,), [rad]."""
        data = self.configuration.data
        self._full[self.adr] = q
        data.qpos[:] = self._full
        mujoco.mj_kinematics(self.model, data)
        return frame(data.site_xmat[self.site], data.site_xpos[self.site])

    def jacobian(self, q: Array) -> Array:
        """The body Jacobian of the tip, (6, joints): its twist in its own frame, [m, rad], per radian of each joint."""
        self.forward(q)
        return self._jacobian()[:, self.model.jnt_dofadr[self.ids]]

    def gravity_torque(self, q: Array) -> Array:
        """The torque of each joint that carries the weight of the arm with its hand at rest, (joints,), [N m]."""
        self.forward(q)
        data = self.configuration.data
        mujoco.mj_comPos(self.model, data)
        mujoco.mj_comVel(self.model, data)
        torque = np.zeros(self.model.nv)
        mujoco.mj_rne(self.model, data, 0, torque)
        return torque[self.model.jnt_dofadr[self.ids]]

    def inverse_jacobian(self, q: Array) -> Array:
        """The pseudoinverse of the Jacobian, (joints, 6): joint rotations, [rad], per twist of the tip, in its frame.

        For an arm of five joints the position of the tip has priority over its rotation, as in `inverse`.
        """
        return np.asarray(np.linalg.pinv(self._cost * self.jacobian(q)) * self._cost[:, 0])

    def _jacobian(self) -> Array:
        """The body Jacobian of the tip for all joints of the model, (6, nv), after `mj_kinematics`."""
        data = self.configuration.data
        mujoco.mj_comPos(self.model, data)
        mujoco.mj_jacSite(self.model, data, self._J[0], self._J[1], self.site)
        return np.asarray((data.site_xmat[self.site].reshape(3, 3).T @ self._J).reshape(6, -1))

    def inverse(self, T: Array, near: Array, turns: int = 40) -> Array | None:
        """Joint angles, (joints,), that bring the tip to T, by Newton steps from `near`; None if they do not converge.

        An arm of five joints may miss the rotation by `LEAN_RAD`.

        Args:
            T: (4, 4), world frame, [m].
            near: Start of the search, (joints,), [rad].
            turns: Largest number of Newton steps.
        """
        data = self.configuration.data
        target = quaternion(T)
        self._full[self.adr] = near
        data.qpos[:] = self._full
        for _ in range(turns):
            mujoco.mj_kinematics(self.model, data)
            error = self._error(T[:3, 3], target)
            off = [*map(abs, error.tolist())]
            shift, turn = max(off[:3]), max(off[3:])
            if shift < self.POSITION_M and turn < self.ANGLE_RAD:
                return self.last
            step = self._step(error, T)
            if step is None:
                return None
            longest = float(np.abs(step).max())
            # Five joints: the position is reached and the rotation no longer improves.
            if self._leans and shift < self.POSITION_M and longest < self.ANGLE_RAD:
                return self.last if turn < self.LEAN_RAD else None
            # No joint turns by more than half a radian in one step: far from the target the linearisation is wrong.
            mujoco.mj_integratePos(self.model, data.qpos, step, min(1.0, 0.5 / max(longest, 1e-12)))
        return None

    def _error(self, position: Array, turned: Array) -> Array:
        """The error of the tip to a position, (3,), and a quaternion: (6,), in the frame of the tip, [m] and [rad]."""
        data = self.configuration.data
        error = np.empty(6)
        error[:3] = (position - data.site_xpos[self.site]) @ data.site_xmat[self.site].reshape(3, 3)
        mujoco.mju_mat2Quat(self._turned, data.site_xmat[self.site])
        mujoco.mju_subQuat(error[3:], turned, self._turned)
        return error

    def _step(self, error: Array, T: Array) -> Array | None:
        """One Newton step of all joints, (nv,), towards T; None if the programme has no solution.

        Without limits, mink's quadratic programme is a linear system. If its solution keeps the limits, it also solves
        the programme.
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
        step: Any = dgesv(H, c)[2]  # violates no limit in most cases, so the programme below is rare
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
    """Compile the arm alone, at its base pose."""
    spec = mujoco.MjSpec.from_string(arm.model) if arm.model is not None else load_model(arm.mjcf, "arm")
    stand = pose.unpack(np.array([*arm.base, *arm.turn]))
    for body in spec.worldbody.bodies:
        T = pose.pack(stand @ pose.unpack(np.array([*body.pos, *body.quat])))
        body.pos = T[:3]
        body.quat = T[3:]
    return spec.compile()
