"""The arm as data, and its inverse kinematics by mink on a model of the arm alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import mink
import mujoco
import numpy as np

from apo_bench.errors import InputError, unknown
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array, frozen
from apo_bench.geometry.records import copyable
from apo_bench.records.short_names import FOREIGN_ARMS
from apo_bench.resources import folder
from apo_bench.simulation.arms.hand import Hand


@final
@copyable
@dataclass(frozen=True, eq=False)
class Limits:
    """What an arm can do; None: nothing is said."""

    payload_kg: float | None = None
    """Of what is held, without the gripper."""
    speed_rad_s: Array | None = None
    """(joints,), the fastest each may turn."""
    torque_nm: Array | None = None
    """(joints,), the most each can push; infinite where nothing is said."""
    fingers_m_s: float = 0.28
    """How fast the command of each finger moves at most."""


@final
@copyable
@dataclass(frozen=True, eq=False)
class Arm:
    """An arm with a gripper of two sides, ready to be put into a scene.

    `read_arm(FILE.toml)` makes one of the description of any arm: it finds joints, drives and pads, and measures the
    gripper. Whoever has an MJCF file that is as the fields say may make one directly, without `model` and `hand`. The
    site `tip` lies between the fingertips: z points ahead, x along the closing direction.
    """

    mjcf: Path
    """The MJCF file of the whole, or the file by which the arm was described."""
    base: tuple[float, float, float]
    """Where its base stands, world, [m]."""
    joints: tuple[str, ...]
    """Each has a position actuator of the same name."""
    tip: str
    fingers: tuple[str, ...]
    """Slide joints, zero when closed, opening [m] per finger; those of the hand, where that was measured."""
    grip: str
    """The position actuator of the fingers; empty where the hand was measured."""
    mount: str
    """The body that a part is welded to by the ideal grasp."""
    home: Array
    """Joint angles near which inverse kinematics starts, [rad]."""
    opening_m: float
    """Widest opening per finger."""
    squeeze_m: float = 0.03
    """How far inside the part the fingers are commanded: beyond it the actuator's force limit rules."""
    turn: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    """How its base is turned, quaternion (w, x, y, z), world."""
    model: str | None = None
    """The whole as MJCF text, where the arm was described by a file."""
    hand: Hand | None = None
    """What the gripper does, where that was measured."""
    limits: Limits = Limits()
    """What it can do."""
    files: tuple[Path, ...] = ()
    """All files that it was made of; none: `mjcf` alone."""
    control: str = "own position actuators"
    """What moves the joints, and how much stronger than in the model the drive of the gripper is, if it is."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "home", frozen(self.home, len(self.joints)))
        object.__setattr__(self, "files", self.files or (self.mjcf,))

    def finger_joints(self, opening: float) -> Array:
        """Where the joints of `fingers` are at an opening of the empty hand, (k,)."""
        return np.full(len(self.fingers), opening) if self.hand is None else self.hand.state(opening)


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
DESCRIBED = ("ur5e_primitive", "panda_primitive")
"""Arms that come with the benchmark as arm files."""


def arm_names() -> tuple[str, ...]:
    """The short names of arms."""
    return (*_ARMS, *DESCRIBED)


def find_arm(given: str | Arm) -> Arm:
    """An arm by short name, `module:name`, or as the object itself."""
    if isinstance(given, Arm):
        return given
    if given.endswith(".toml"):
        from apo_bench.simulation.arms.building import read_arm

        return read_arm(given)
    if given in DESCRIBED:
        from apo_bench.simulation.arms.building import read_arm

        return read_arm(folder("assets") / "arms" / f"{given}.toml")
    if given.startswith(FOREIGN_ARMS):
        from apo_bench.simulation.arms.foreign import find_foreign

        return find_foreign(given)
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
        known = unknown("arm", given, arm_names())
        raise InputError(
            f"{known} Or give your own as FILE.toml, menagerie:NAME, robosuite:NAME, or 'package.module:name'."
        )
    return _ARMS[given]()


class Kinematics:
    """Forward and inverse kinematics of the arm alone."""

    POSITION_M = 1e-6
    ANGLE_RAD = 1e-5
    DAMPING = 1e-9
    GAIN = 0.95
    """A step takes at most this part of the way to a joint's limit."""

    POSTURE = 2e-4
    """How much an arm with more than six joints prefers its home, as a cost: the tip is off by some 1e-8 m for it."""

    def __init__(self, arm: Arm, posture: bool = True) -> None:
        self.model = _alone(arm)
        self.configuration = mink.Configuration(self.model)
        self.adr = np.array([int(self.model.jnt_qposadr[self.model.joint(j).id]) for j in arm.joints])
        self.tip = arm.tip
        self._mount = arm.mount
        self.site = self.model.site(arm.tip).id
        self._task = mink.FrameTask(arm.tip, "site", position_cost=1.0, orientation_cost=0.3)
        self._limits = [mink.ConfigurationLimit(self.model)]
        self._full = self.model.qpos0.copy()
        limited = self.model.jnt_limited.astype(np.bool_)
        self._range: Array = np.where(limited[:, None], self.model.jnt_range, (-np.inf, np.inf)).T
        self.ids = [int(self.model.joint(j).id) for j in arm.joints]
        self._posture: Any = None
        if posture:
            self.keep_near(arm.home)

    def keep_near(self, home: Array) -> None:
        """Of arms with more than six joints: which joint angles they prefer from now on, [rad]."""
        if len(self.adr) > 6:
            self._posture = _posture_task(self, home)

    @property
    def first_link(self) -> str:
        """The first body of the arm that moves: everything that moves hangs on it."""
        tree = self.model.body_treeid[self.model.body(self._mount).id]
        return str(self.model.body(int(self.model.tree_bodyadr[tree])).name)

    @property
    def range_of_joints(self) -> Array:
        """(2, joints): the lowest and the highest angle of each, [rad]."""
        return self._range[:, self.ids]

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
        if self._posture is not None:
            more = self._posture.compute_qp_objective(self.configuration)
            H, c = H + more[0], c + more[1]
        np.einsum("ii->i", H)[:] += self.DAMPING
        step: Array = np.linalg.solve(H, -c)
        low, high = self.GAIN * (self._range - self.configuration.q)
        if (step >= low).all() and (step <= high).all():
            return step
        try:
            tasks = [self._task] if self._posture is None else [self._task, self._posture]
            found = mink.solve_ik(self.configuration, tasks, 1.0, "daqp", damping=self.DAMPING, limits=self._limits)
        except mink.exceptions.MinkError:
            return None
        return np.asarray(found)


def _alone(arm: Arm) -> Any:
    """The model of the arm where it stands, and nothing else."""
    if arm.model is None:
        spec = mujoco.MjSpec.from_file(str(arm.mjcf))
        spec.worldbody.first_body().pos = arm.base
        return spec.compile()
    spec = mujoco.MjSpec.from_string(arm.model)
    stand = pose.unpack(np.array([*arm.base, *arm.turn]))
    for body in spec.worldbody.bodies:
        T = pose.pack(stand @ pose.unpack(np.array([*body.pos, *body.quat])))
        body.pos, body.quat = T[:3], T[3:]
    return spec.compile()


def _posture_task(kinematics: Kinematics, home: Array) -> Any:
    """What keeps the elbow where it is at home, (mink's `PostureTask`)."""
    cost = np.zeros(kinematics.model.nv)
    cost[kinematics.model.jnt_dofadr[kinematics.ids]] = Kinematics.POSTURE
    task = mink.PostureTask(kinematics.model, cost=cost)
    q = kinematics.model.qpos0.copy()
    q[kinematics.adr] = home
    task.set_target(q)
    return task
