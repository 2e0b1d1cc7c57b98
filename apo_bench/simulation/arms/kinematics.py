"""Forward and inverse kinematics of an arm by mink, on a model of the arm alone.

Where an arm waits, if nobody says: of the ways to hold the tip over the table the one that has most room.
"""

from dataclasses import replace
from itertools import product
from typing import Any

import mink
import mujoco
import numpy as np

from apo_bench.errors import InputError
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
        self.model = _alone(arm)
        self.configuration = mink.Configuration(self.model)
        self.ids = [int(self.model.joint(j).id) for j in arm.joints]
        self.adr = self.model.jnt_qposadr[self.ids]
        self._mount = arm.mount
        self.site = self.model.site(arm.tip).id
        self._leans = len(arm.joints) < 6
        turning = self.LEANING if self._leans else 0.3
        self._task = mink.FrameTask(arm.tip, "site", position_cost=1.0, orientation_cost=turning)
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
        tree = self.model.body_treeid[self.model.body(self._mount).id]
        return str(self.model.body(int(self.model.tree_bodyadr[tree])).name)

    @property
    def range_of_joints(self) -> Array:
        """(2, joints): the lowest and the highest angle of each, [rad]."""
        return self._range[:, self.ids]

    @property
    def last(self) -> Array:
        """Where the last search for joint angles ended, or what was last asked for, (joints,), [rad]."""
        return np.array(self.configuration.q[self.adr])

    def forward(self, q: Array) -> Array:
        """The pose of the tip, (4, 4), world."""
        self._full[self.adr] = q
        self.configuration.update(self._full)
        return frame(self.configuration.data.site_xmat[self.site], self.configuration.data.site_xpos[self.site])

    def jacobian(self, q: Array) -> Array:
        """The body Jacobian of the tip, (6, joints): its twist in its own frame, [m, rad], per radian of each joint."""
        self._full[self.adr] = q
        self.configuration.update(self._full)
        whole = self.configuration.get_frame_jacobian(str(self.model.site(self.site).name), "site")
        return np.asarray(whole[:, self.model.jnt_dofadr[self.ids]])

    def inverse(self, T: Array, near: Array, turns: int = 40) -> Array | None:
        """Joint angles that bring the tip to T, found by Newton steps from `near`; None if there are none there.

        The turn about one axis is left to an arm of five joints, within `LEAN_RAD`.
        """
        self._task.set_target(mink.SE3(np.concatenate([quaternion(T), T[:3, 3]])))
        self._full[self.adr] = near
        self.configuration.update(self._full)
        for _ in range(turns):
            error: Any = self._task.compute_error(self.configuration)
            off = error.tolist()
            if all(abs(x) < self.POSITION_M for x in off[:3]) and all(abs(x) < self.ANGLE_RAD for x in off[3:]):
                return self.last
            step = self._step()
            if step is None:
                return None
            if self._leans and max(map(abs, off[:3])) < self.POSITION_M and np.abs(step).max() < self.ANGLE_RAD:
                return self.last if max(map(abs, off[3:])) < self.LEAN_RAD else None
            # No joint turns by more than half a radian in one step: far from the target the linearisation is wrong.
            longest = float(np.abs(step).max())
            self.configuration.integrate_inplace(step * min(1.0, 0.5 / max(longest, 1e-12)), 1.0)
        return None

    def _step(self) -> Array | None:
        """The step of all joints that mink's quadratic programme finds; None if it finds none.

        Without limits the programme is a linear system. Where its solution keeps them, it is that of the programme too.
        """
        # The least of 1/2 s^T H s + c^T s with H = J^T W J and c = -J^T W error: without limits H s = -c. A little
        # damping on the diagonal keeps H regular where the arm is straight.
        H, c = self._task.compute_qp_objective(self.configuration)
        if self._posture is not None:
            more = self._posture.compute_qp_objective(self.configuration)
            H = H + more[0]
            c = c + more[1]
        np.einsum("ii->i", H)[:] += self.DAMPING
        step: Array = np.linalg.solve(H, -c)
        low, high = self.GAIN * (self._range - self.configuration.q)
        if (step >= low).all() and (step <= high).all():
            return step
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


_AT = (-0.05, 0.0, 0.30)
_TABLE = [(-0.15, -0.25, 0.03), (-0.15, 0.25, 0.3), (0.2, 0.25, 0.03), (0.2, -0.25, 0.3)]
"""Places of the tip, [m], and turns from the way it waits, [rad], at which there should be room; ways it may wait."""
_TURNS = (-1.6, 0.0, 1.6)
_WAYS = (0.0, np.pi / 2, np.pi, -np.pi / 2)
_MOST_PLACES = len(_TABLE) * len(_TURNS)
_NEARER_M = (-0.4, -0.3, -0.2, -0.1)
_STANDS_M = (0.0, 0.1, 0.2)
"""Where the base of an arm may stand that reaches at most half of these: behind the middle of the table, how high."""
_TRIES = 40
_QUICK_TRIES = 16
_WIDEST = 3.0
_SAME_RAD = 0.2
_TABLE_ROOM_M = 0.02
_NEAR = 0.4
_ENOUGH_RAD = 0.3
"""More room to a limit than this counts less than links that are high above the table."""


def tip_down(at: Array, turn: float = 0.0) -> Array:
    """A tip that looks down, (4, 4); at turn 0 its fingers close along x."""
    c = np.cos(turn)
    s = np.sin(turn)
    return frame(np.array([[-c, s, 0.0], [-s, -c, 0.0], [0.0, 0.0, 1.0]]) @ np.diag([1.0, -1.0, -1.0]), at)


def with_home(arm: Arm, base_is_stated: bool) -> Arm:
    """The arm with the joint angles at which it waits: from there the tip reaches most of the table with most room.

    Args:
        base_is_stated: Else the base of an arm that is short stands nearer, or on a stand, where most is reached.

    Raises:
        InputError: The arm does not reach over the table at all.
    """
    best = _home(arm, _TRIES)
    if not base_is_stated and (best is None or best[0] <= _MOST_PLACES / 2):
        for z, x in product(_STANDS_M, _NEARER_M):
            nearer = replace(arm, base=(x, 0.0, z))
            found = _home(nearer, _QUICK_TRIES)
            if found is not None and (best is None or found[0] > best[0]):
                best = found
                arm = nearer
    if best is None:
        at = ", ".join(f"{1e3 * x:g}" for x in _AT)
        raise InputError(
            f"{arm.mjcf}: the tip does not reach ({at}) mm looking down; move the 'base', which stands at "
            f"({', '.join(f'{1e3 * x:g}' for x in arm.base)}) mm."
        )
    return replace(arm, home=best[1])


def _home(arm: Arm, tries: int) -> tuple[int, Array] | None:
    """How many places on the table are reached from the best home, and that, [rad]; None where there is no home."""
    kinematics = Kinematics(arm, posture=False)
    rng = np.random.default_rng(0)
    low, high = (np.clip(limit, -_WIDEST, _WIDEST) for limit in kinematics.range_of_joints)
    homes: list[tuple[Array, float]] = []
    for i in range(tries):
        start = rng.uniform(low, high)
        near = _NEAR * (i > 0)
        start = start if i % 2 else (low + high) / 2 + near * (start - (low + high) / 2)
        way = _WAYS[i // 2 % len(_WAYS)]
        q = kinematics.inverse(tip_down(np.array(_AT), way), start, 25)
        if q is None:
            continue
        q = _unwound(q, *kinematics.range_of_joints)
        if any(np.abs(q - other).max() < _SAME_RAD for other, _ in homes) or _in_table(kinematics, q):
            continue
        homes.append((q, way))
    worths = [(_worth(kinematics, *each), each[0]) for each in homes]
    worth, home = max(worths, key=lambda each: each[0], default=((0, 0.0, 0.0), None))
    return None if home is None else (worth[0], home)


def _worth(kinematics: Kinematics, q: Array, way: float) -> tuple[int, float, float]:
    """Places reached, room to the limits as far as it is needed, height of the joints."""
    reached, least = room(kinematics, q, way)
    kinematics.forward(q)
    moved = kinematics.model.body_jntnum > 0
    return reached, round(min(least, _ENOUGH_RAD), 2), float(kinematics.configuration.data.xpos[moved, 2].mean())


def room(kinematics: Kinematics, home: Array, way: float) -> tuple[int, float]:
    """How many places on the table are reached from home, and the least distance of a joint from its limit, [rad].

    Args:
        way: How the tip is turned there, [rad].
    """
    kinematics.keep_near(home)
    low, high = kinematics.range_of_joints
    reached = 0
    least = np.inf
    for turn in _TURNS:
        for at in _TABLE:
            q = kinematics.inverse(tip_down(np.array(at), way + turn), home, 25)
            if q is not None:
                reached += 1
                least = min(least, float(np.minimum(q - low, high - q).min()))
    return reached, least


def _unwound(q: Array, low: Array, high: Array) -> Array:
    """The same place with every joint less than half a turn from zero, where its limits let it be."""
    near = (q + np.pi) % (2 * np.pi) - np.pi
    return np.where((near >= low) & (near <= high), near, q)


def _in_table(kinematics: Kinematics, q: Array) -> bool:
    """Whether the centre of mass of a link lies in the table."""
    kinematics.forward(q)
    moved = kinematics.model.body_jntnum[1:] > 0
    return bool((kinematics.configuration.data.xipos[1:][moved, 2] < _TABLE_ROOM_M).any())
