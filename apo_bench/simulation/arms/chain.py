"""Find the chain of hinge joints from the base of an arm to its flange."""

from typing import Any

import mujoco
import numpy as np

from apo_bench.errors import InputError, require, unknown
from apo_bench.geometry import Array, pose
from apo_bench.simulation.arms.description import ArmDescription
from apo_bench.simulation.arms.shapes import geom_reach
from apo_bench.simulation.frames import frame, rotation

# Usual names of the site or body of a flange, by preference.
_USUAL_FLANGES = ("attachment_site", "flange", "tool0", "ee_site", "right_hand", "hand", "attachment", "pinch_site")
_JAWS = ("jaw", "finger", "gripper", "claw")
"""Words by which the name of a hinge shows that it belongs to the gripper, if the model does not branch there."""
_LEAST_JOINTS = 5  # hinges of an arm
_MOST_JOINTS = 8  # hinges of an arm


def find_flange(model: Any, description: ArmDescription) -> tuple[int, Array]:
    """The last body of the arm, and the pose of the flange in it, (4, 4).

    If no flange is known, a gripper from its own file is mounted where the last link ends along its joint axis.
    """
    sites = {model.site(i).name: i for i in range(model.nsite)}
    bodies = {model.body(i).name: i for i in range(1, model.nbody)}
    name = description.flange
    if name is None:
        name = next((each for each in _USUAL_FLANGES if each in sites or each in bodies), None)
    if name is None:
        last = _last_link(model, description)
        return last, np.eye(4) if description.gripper.mjcf is None else _end_of(model, last)
    if name in sites:
        site = sites[name]
        return int(model.site_bodyid[site]), frame(rotation(model.site_quat[site]), model.site_pos[site])
    if name not in bodies:
        raise InputError(f"{description.file}: {unknown('flange', name, (*sites, *bodies))}")
    return bodies[name], np.eye(4)


def _last_link(model: Any, description: ArmDescription) -> int:
    """The body of the last stated joint; else of the last hinge before the model branches or the gripper begins."""
    if description.joints is not None and description.joints[-1] in [model.joint(j).name for j in range(model.njnt)]:
        return int(model.jnt_bodyid[model.joint(description.joints[-1]).id])
    body = 0
    while True:
        moving = [b for b in range(1, model.nbody) if int(model.body_parentid[b]) == body and _moves(model, b)]
        # Two or more moving children are fingers, none is the end of the chain.
        if len(moving) != 1:
            break
        body = moving[0]
    # Back to a body with a joint; without a branch also past jaws of the gripper.
    while body and (not model.body_jntnum[body] or (not moving and _is_jaw(model, body))):
        body = int(model.body_parentid[body])
    require(body, f"{description.model_file}: the arm has no joints; give the MJCF file of an arm.")
    return body


def _is_jaw(model: Any, body: int) -> bool:
    """Whether the name of a body's joint shows that it belongs to the gripper."""
    return any(word in model.joint(int(model.body_jntadr[body])).name.lower() for word in _JAWS)


def _end_of(model: Any, body: int) -> Array:
    """The end of a link along its joint axis, in the frame of the link, (4, 4): z along the axis to the longer side."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    joint = int(model.body_jntadr[body])
    at = data.xanchor[joint]
    axis = data.xaxis[joint]
    fixed = np.flatnonzero(model.body_weldid[model.geom_bodyid] == body)  # geoms rigidly attached to the link
    ends = [max((geom_reach(model, data, int(g), to) for g in fixed), default=0.0) - at @ to for to in (axis, -axis)]
    ahead = axis if ends[0] >= ends[1] else -axis
    across = np.cross(ahead, np.eye(3)[int(np.abs(ahead).argmin())])
    across /= np.linalg.norm(across)
    T = frame(np.column_stack([across, np.cross(ahead, across), ahead]), at + max(ends) * ahead)
    return np.asarray(pose.inverse(frame(data.xmat[body], data.xpos[body])) @ T)


def _moves(model: Any, body: int) -> bool:
    """Whether a body or one of its descendants has a joint."""
    if model.body_jntnum[body]:
        return True
    return any(_moves(model, b) for b in range(body + 1, model.nbody) if int(model.body_parentid[b]) == body)


def find_joints(model: Any, flange: int, description: ArmDescription) -> list[str]:
    """Names of the hinges between base and flange, in this order."""
    chain: list[int] = []
    body = flange
    while body:
        at = int(model.body_jntadr[body])
        chain = [*range(at, at + int(model.body_jntnum[body])), *chain]
        body = int(model.body_parentid[body])
    names = [model.joint(j).name for j in chain]
    for j, name in zip(chain, names, strict=True):
        require(
            int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_HINGE),
            f"{description.model_file}: the joint '{name}' of the arm is no hinge; arms of hinges can be used.",
        )
    if description.joints is not None:
        require(
            sorted(description.joints) == sorted(names),
            f"{description.file}: 'joints' are {', '.join(description.joints)}; between base and flange lie "
            f"{', '.join(names) or 'none'}.",
        )
        names = [name for name in names if name in description.joints]
    require(
        _LEAST_JOINTS <= len(names) <= _MOST_JOINTS,
        f"{description.model_file}: {len(names)} hinges lie between base and flange ({', '.join(names) or 'none'}); "
        f"{_LEAST_JOINTS} to {_MOST_JOINTS} are needed, so check 'flange'.",
    )
    return names
