"""How hard the pads of a gripper push on a part between them."""

from typing import NamedTuple

import mujoco
import numpy as np

from apo_bench.geometry import Array
from apo_bench.simulation.arms.rig import STEP_S, Rig
from apo_bench.simulation.frames import quaternion

PROBE = "probe"
"""The body between the pads on which their force is measured; it stands elsewhere until then."""
PROBE_WIDE = 0.5
"""How wide it is, as a part of the opening."""
_AWAY_M = 1.0
_SQUEEZES_M = (0.03, 0.015, 0.008, 0.004, 0.002, 0.001)
_MOST_N = 60.0
"""How far inside a part fingers are sent at most: less where they press harder than this."""
_PROBE_HIGH_M = 0.006
_STEPS = 16
_SLOWLY_S = 0.02
_LOOKS = 100
"""Half of its height, about the tip; in how many steps a gripper is closed on it, and how long each takes; steps over
which the force is averaged."""


class Press(NamedTuple):
    """What two pads do to a part between them."""

    force_n: float
    """Of each, the mean of both."""
    friction: float


def force_of(rig: Rig, at: Array, R: Array, openings: Array, commands: Array) -> tuple[Press, float]:
    """How hard the pads push on a part between them, and how far inside it they are sent for that, [m].

    Farther means harder where the drive is soft; it is not more than a part should be pressed by.
    """
    model = rig.model
    data = rig.data
    opened = commands[-1]
    body = model.body(PROBE).id
    geom = int(model.body_geomadr[body])
    half = np.array([PROBE_WIDE * float(openings[-1]), 0.02, _PROBE_HIGH_M])
    model.geom_size[geom] = half
    model.geom_rbound[geom] = float(np.linalg.norm(half))
    model.geom_aabb[geom, 3:] = half
    mocap = int(model.body_mocapid[body])
    data.mocap_pos[mocap] = (0.0, 0.0, -_AWAY_M)
    press, squeeze = Press(0.0, 0.0), 0.0
    for squeeze in _SQUEEZES_M:
        rig.settle(opened)
        data.mocap_pos[mocap] = at
        data.mocap_quat[mocap] = quaternion(R)
        closed = np.array([np.interp(half[0] - squeeze, openings, column) for column in commands.T])
        press = _press(rig, geom, opened, closed, R[:, 0])
        data.mocap_pos[mocap] = (0.0, 0.0, -_AWAY_M)
        if press.force_n <= _MOST_N:
            break
    return press, squeeze


def _press(rig: Rig, probe: int, opened: Array, closed: Array, across: Array) -> Press:
    data = rig.data
    for part in np.linspace(0.0, 1.0, _STEPS + 1)[1:]:
        rig.settle(opened + part * (closed - opened), _SLOWLY_S)
    rig.settle(closed)
    total = 0.0
    rubs = 0.0
    wrench = np.zeros(6)
    for _ in range(_LOOKS):
        rig.settle(closed, STEP_S)
        for c in range(data.ncon):
            mujoco.mj_contactForce(rig.model, data, c, wrench)
            push = abs(float(wrench[0] * (data.contact[c].frame[:3] @ across)))
            pad = next(int(g) for g in data.contact[c].geom if g != probe)
            total += push
            rubs += push * float(rig.model.geom_friction[pad, 0])
    return Press(total / 2 / _LOOKS, round(rubs / total, 6) if total else 0.0)
