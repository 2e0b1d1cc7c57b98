"""Fill the grooves between the boxes of a fingertip, which would wedge round parts.

A round part in a groove between two boxes overlaps their sides the least, so MuJoCo pushes along the sides and not away
from the pad. The part is wedged, and opening fingers take it along. The hand of the Panda in Menagerie, with four boxes
of 6 mm and gaps of 4 and 5 mm, holds it with 7 N.
"""

from collections.abc import Sequence
from itertools import permutations
from typing import Any

import mujoco
import numpy as np

_GROOVE_M = 0.008  # wider gaps are no grooves
_SAME_M = 1e-5  # smaller differences of ends of boxes are none


def fill_grooves(spec: Any, joints: Sequence[str]) -> None:
    """Merge boxes of a finger that differ only in their positions along one axis and have a narrow gap between them.

    Args:
        joints: Joints of the arm; bodies that they move are no fingers.
    """
    for body in spec.bodies[1:]:
        moved = [joint.name for joint in body.joints]
        if moved and not set(moved) & set(joints):
            while _fill_one(spec, body):
                pass


def _fill_one(spec: Any, body: Any) -> bool:
    """Merge the first such pair of boxes of a body; return whether there was one."""
    boxes = [geom for geom in body.geoms if geom.type == mujoco.mjtGeom.mjGEOM_BOX and geom.contype]
    for one, other in permutations(boxes, 2):
        # Ends along the axes of the boxes, which are those of the finger.
        if not (_upright(one) and _upright(other)):
            continue
        low, high = one.pos - one.size, one.pos + one.size
        far, end = other.pos - other.size, other.pos + other.size
        # Axes along which the ends of both boxes differ.
        differ = np.flatnonzero((np.abs(low - far) > _SAME_M) | (np.abs(high - end) > _SAME_M))
        if len(differ) == 1 and _SAME_M < (far - high)[differ[0]] < _GROOVE_M:
            one.pos, one.size = (low + end) / 2, (end - low) / 2
            spec.delete(other)
            return True
    return False


def _upright(geom: Any) -> bool:
    """Whether a geom is not rotated in its body."""
    return bool(abs(geom.quat[0]) > 1.0 - _SAME_M)
