"""The room that a gripper takes, as boxes about its tip."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import mujoco
import numpy as np

from apo_bench.geometry.solid import Box
from apo_bench.simulation.arms.arm import Arm
from apo_bench.simulation.arms.kinematics import Kinematics

UPRIGHT_M = 0.001
"""Room above and below: supports are where they are known to be."""


@lru_cache(maxsize=64)
def gripper_boxes(kinematics: Kinematics, arm: Arm, opening: float, margin: float = 0.0) -> tuple[Box, ...]:
    """The geoms of the gripper in the frame of the tip, each as the box around it.

    Args:
        opening: Of each finger, [m].
        margin: Added on every level side, [m]; above and below, `UPRIGHT_M` is.
    """
    model = kinematics.model
    data = _opened(model, arm, opening)
    tip = model.site(arm.tip).id
    R = data.site_xmat[tip].reshape(3, 3)
    p = data.site_xpos[tip]
    boxes = []
    for g in _geoms(model, arm):
        R_tip_geom = R.T @ data.geom_xmat[g].reshape(3, 3)
        center = model.geom_aabb[g, :3]
        half = model.geom_aabb[g, 3:]
        at = R.T @ (data.geom_xpos[g] - p) + R_tip_geom @ center
        boxes.append(Box(f"gripper{g}", at, np.abs(R_tip_geom) @ half + [margin, margin, min(margin, UPRIGHT_M)]))
    return tuple(boxes)


def _opened(model: Any, arm: Arm, opening: float) -> Any:
    data = mujoco.MjData(model)
    for finger, at in zip(arm.fingers, arm.finger_joints(opening), strict=True):
        data.qpos[model.jnt_qposadr[model.joint(finger).id]] = at
    mujoco.mj_kinematics(model, data)
    return data


def _geoms(model: Any, arm: Arm) -> list[int]:
    """Every geom that can touch something, of the mount and of what hangs on it."""
    inside = {model.body(arm.mount).id}
    for body in range(model.nbody):
        if int(model.body_parentid[body]) in inside:
            inside.add(body)
    touching = (model.geom_contype | model.geom_conaffinity) != 0
    return [g for g in range(model.ngeom) if touching[g] and int(model.geom_bodyid[g]) in inside]
