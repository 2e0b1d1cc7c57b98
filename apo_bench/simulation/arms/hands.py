"""Find the names of a gripper file in the model of its arm, and scale the gripper's drive."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from apo_bench.errors import InputError, require_known
from apo_bench.simulation.arms.arm import Hand


def find_pad(model: Any, name: str, path: Path) -> str:
    """The name of the geom of a pad: the geom called `name`, or the first box of the body called `name`.

    Raises:
        InputError: There is none; `path` is the gripper file.
    """
    if name in [model.geom(g).name for g in range(model.ngeom)]:
        return name
    boxes = np.flatnonzero(model.geom_type == int(mujoco.mjtGeom.mjGEOM_BOX))
    pads = [g for g in boxes if model.body(int(model.geom_bodyid[g])).name == name]
    if not pads:
        raise InputError(f"{path}: the arm has no geom '{name}', and no body of that name with a box; correct 'pads'.")
    return str(model.geom(int(pads[0])).name)


def check_names(model: Any, hand: Hand, mount: str, path: Path) -> None:
    """Raise an `InputError` if the gripper file `path` names a body, actuator or joint that the arm does not have."""
    require_known("body", mount, [model.body(i).name for i in range(model.nbody)], place=path)
    for name in hand.actuators:
        require_known("actuator", name, [model.actuator(i).name for i in range(model.nu)], place=path)
    for name in hand.joints:
        require_known("joint", name, [model.joint(i).name for i in range(model.njnt)], place=path)


def scale_drive(spec: Any, actuators: Sequence[str], by: float) -> None:
    """Scale the strength of a gripper's drive: gains, damping and limits of its actuators, limits of their joints.

    A positive damping is a ratio (`dampratio`), which needs no scaling.
    """
    for name in actuators if by != 1.0 else ():
        actuator = spec.actuator(name)
        damping = actuator.biasprm[2]  # gains and bias of a position actuator: (0, -kp, -kd)
        actuator.gainprm[:3] = by * actuator.gainprm[:3]
        actuator.biasprm[:2] = by * actuator.biasprm[:2]
        actuator.biasprm[2] = damping if damping > 0.0 else by * damping
        actuator.forcerange[:] = by * actuator.forcerange
        joint = spec.joint(actuator.target)
        if joint is not None:
            joint.actfrcrange[:] = by * joint.actfrcrange
