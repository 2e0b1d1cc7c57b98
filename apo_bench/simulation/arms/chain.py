"""The chain of hinges from the base of an arm to its flange."""

from typing import Any

import mujoco
import numpy as np

from apo_bench.errors import InputError, unknown
from apo_bench.geometry import Array
from apo_bench.simulation.arms.description import ArmDescription
from apo_bench.simulation.frames import frame, rotation

_USUAL_FLANGES = ("attachment_site", "flange", "tool0", "ee_site", "right_hand", "hand", "attachment")
_MOST_JOINTS = 8


def find_flange(model: Any, description: ArmDescription) -> tuple[int, Array]:
    """The body at the end of the arm, and the frame of the flange in it."""
    sites = {model.site(i).name: i for i in range(model.nsite)}
    bodies = {model.body(i).name: i for i in range(1, model.nbody)}
    name = description.flange
    if name is None:
        name = next((each for each in _USUAL_FLANGES if each in sites or each in bodies), None)
    if name is None:
        if description.gripper.mjcf is not None:
            raise InputError(
                f"{description.file}: where the gripper is mounted is not known; state 'flange', a site or body of "
                f"the arm ({', '.join((*sites, *bodies))})."
            )
        return _last_link(model, description), np.eye(4)
    if name in sites:
        site = sites[name]
        return int(model.site_bodyid[site]), frame(rotation(model.site_quat[site]), model.site_pos[site])
    if name not in bodies:
        raise InputError(f"{description.file}: {unknown('flange', name, (*sites, *bodies))}")
    return bodies[name], np.eye(4)


def _last_link(model: Any, description: ArmDescription) -> int:
    """The body of the last joint that is named, or of the last hinge from which the model branches."""
    if description.joints is not None:
        known = [model.joint(j).name for j in range(model.njnt)]
        if description.joints[-1] in known:
            return int(model.jnt_bodyid[model.joint(description.joints[-1]).id])
    body = 0
    while True:
        moving = [b for b in range(1, model.nbody) if int(model.body_parentid[b]) == body and _moves(model, b)]
        if len(moving) != 1:
            break
        body = moving[0]
    while body and not model.body_jntnum[body]:
        body = int(model.body_parentid[body])
    if not body:
        raise InputError(f"{description.mjcf}: the arm has no joints; give the MJCF file of an arm.")
    return body


def _moves(model: Any, body: int) -> bool:
    """Whether a joint is at a body or behind it."""
    if model.body_jntnum[body]:
        return True
    return any(_moves(model, b) for b in range(body + 1, model.nbody) if int(model.body_parentid[b]) == body)


def find_joints(model: Any, flange: int, description: ArmDescription) -> list[str]:
    """The hinges between the base and the flange, in this order."""
    chain: list[int] = []
    body = flange
    while body:
        at = int(model.body_jntadr[body])
        chain = [*range(at, at + int(model.body_jntnum[body])), *chain]
        body = int(model.body_parentid[body])
    names = [model.joint(j).name for j in chain]
    for j, name in zip(chain, names, strict=True):
        if int(model.jnt_type[j]) != int(mujoco.mjtJoint.mjJNT_HINGE):
            raise InputError(
                f"{description.mjcf}: the joint '{name}' of the arm is no hinge; arms of hinges can be used."
            )
    if description.joints is not None:
        if sorted(description.joints) != sorted(names):
            raise InputError(
                f"{description.file}: 'joints' are {', '.join(description.joints)}; between base and flange lie "
                f"{', '.join(names) or 'none'}."
            )
        names = [name for name in names if name in description.joints]
    if not 6 <= len(names) <= _MOST_JOINTS:
        raise InputError(
            f"{description.mjcf}: {len(names)} hinges lie between base and flange ({', '.join(names) or 'none'}); 6 to "
            f"{_MOST_JOINTS} are needed, so check 'flange'."
        )
    return names
