"""Fill grooves between the boxes of a fingertip.

MuJoCo pushes on a round part in a groove between two boxes along the sides of the groove, where it overlaps them least,
and not away from the pad. The part is wedged, and opening fingers take it along: 7 N at the hand of the Panda in
Menagerie, four boxes of 6 mm with 4 and 5 mm between them.
"""

from collections.abc import Sequence
from itertools import permutations
from typing import Any

import mujoco
import numpy as np

_GROOVE_M = 0.008  # wider is no groove
_SAME_M = 1e-5  # boxes whose ends differ by less are equal


def fill_grooves(spec: Any, joints: Sequence[str]) -> None:
    """Make one box of two of the same finger that differ only in their places along one axis.

    Args:
        joints: Of the arm; bodies that turn by them are no fingers.
    """
    for body in spec.bodies[1:]:
        moved = [joint.name for joint in body.joints]
        if moved and not set(moved) & set(joints):
            while _fill_one(spec, body):
                pass


def _fill_one(spec: Any, body: Any) -> bool:
    boxes = [geom for geom in body.geoms if geom.type == mujoco.mjtGeom.mjGEOM_BOX and geom.contype]
    for one, other in permutations(boxes, 2):
        # Ends along the axes of the boxes, which are those of the finger.
        if not (_upright(one) and _upright(other)):
            continue
        low, high = one.pos - one.size, one.pos + one.size
        far, end = other.pos - other.size, other.pos + other.size
        differ = np.flatnonzero((np.abs(low - far) > _SAME_M) | (np.abs(high - end) > _SAME_M))
        if len(differ) == 1 and _SAME_M < (far - high)[differ[0]] < _GROOVE_M:
            one.pos, one.size = (low + end) / 2, (end - low) / 2
            spec.delete(other)
            return True
    return False


def _upright(geom: Any) -> bool:
    return bool(abs(geom.quat[0]) > 1.0 - _SAME_M)
