"""A camera on the hand of an arm that looks at what the fingers hold."""

from typing import Any

import numpy as np

from apo_bench.geometry import Array, pose
from apo_bench.simulation.arms.kinematics import Kinematics
from apo_bench.simulation.frames import frame, quaternion, rotation

WRIST_CAMERA = "wrist"
_PLACE_M = (0.0, 0.07, -0.12)  # of the camera, in the frame of the tip: z points ahead, level insertions go along y
_LOOKS_AT_M = (0.0, 0.06, 0.03)  # the middle of its picture, in the same frame
_FIELD_DEG = 75.0  # vertical field of view


def add_wrist_camera(spec: Any, kinematics: Kinematics) -> None:
    """Add the camera to the replay world.

    Args:
        spec: An `MjSpec` with the arm.
        kinematics: Those of the arm, whose model has the place of the tip on the hand.
    """
    model = kinematics.model
    tip = kinematics.site
    T_hand_tip = frame(rotation(model.site_quat[tip]), model.site_pos[tip])
    T = T_hand_tip @ _place()
    hand = model.body(int(model.site_bodyid[tip])).name
    spec.body(f"arm/{hand}").add_camera(name=WRIST_CAMERA, pos=T[:3, 3], quat=quaternion(T), fovy=_FIELD_DEG)


def _place() -> Array:
    """Return the pose of the camera in the frame of the tip, (4, 4); it looks along its negative z axis."""
    back = np.array(_PLACE_M) - np.array(_LOOKS_AT_M)
    back /= np.linalg.norm(back)
    across = np.array([-1.0, 0.0, 0.0])
    return pose.rigid(np.column_stack([across, np.cross(back, across), back]), np.array(_PLACE_M))
