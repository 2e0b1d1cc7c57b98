"""Find the pads of a gripper: of two groups of shapes that move towards each other, what reaches farthest."""

import numpy as np

from apo_bench.errors import require
from apo_bench.geometry import Array
from apo_bench.simulation.arms.description import GripperDescription
from apo_bench.simulation.arms.rig import Rig
from apo_bench.simulation.arms.shapes import below, geom_reach

_MOVES_M = 0.001
"""What moves less is no finger."""
_TIP_M = 0.012
"""What ends within this of the farthest end is of a pad."""
_SNAP = float(np.cos(np.radians(1.0)))
_SNAP_AHEAD = float(np.cos(np.radians(10.0)))
"""A direction so near to an axis of the flange is meant as that axis."""


def pads_of(
    rig: Rig, gripper: GripperDescription, way: Array, flange: int
) -> tuple[tuple[list[int], list[int]], Array, Array]:
    """The pads of both sides, by geom; the closing direction and the way ahead, unit vectors, world."""
    model = rig.model
    data = rig.data
    hanging = below(model, flange)
    touching = [
        g
        for g in range(model.ngeom)
        if int(model.geom_bodyid[g]) in hanging and (model.geom_contype[g] or model.geom_conaffinity[g])
    ]
    moving = [g for g in touching if np.linalg.norm(way[g]) > _MOVES_M]
    if gripper.pads is not None:
        called = {g: (model.geom(g).name, model.body(int(model.geom_bodyid[g])).name) for g in touching}
        named = [[g for g in touching if name in called[g]] for name in gripper.pads]
        for name, geoms in zip(gripper.pads, named, strict=True):
            require(geoms, f"{rig.path}, gripper: nothing that could touch a part is called '{name}'.")
        moving = named[0] + named[1]
    require(
        len(moving) >= 2,
        f"{rig.path}: nothing of the gripper moves between its ends of command; state 'open' and 'closed'.",
    )
    # The direction in which the motions of all shapes are largest in the mean square: the first right singular vector.
    across = np.linalg.svd(way[moving], full_matrices=False)[2][0]
    first = [g for g in moving if way[g] @ across > 0.3 * np.linalg.norm(way[g])]
    second = [g for g in moving if way[g] @ across < -0.3 * np.linalg.norm(way[g])]
    if gripper.pads is not None:
        first, second = named
    require(first and second, f"{rig.path}: the fingers do not close on each other; name both 'pads' in 'gripper'.")
    R_flange = data.xmat[flange].reshape(3, 3)
    across = _snap(across, R_flange, _SNAP)
    middle = np.mean([data.geom_xpos[g] for g in first + second], axis=0) - data.xpos[flange]
    ahead = middle - (middle @ across) * across
    require(
        np.linalg.norm(ahead) >= 1e-3,
        f"{rig.path}: the fingers do not reach ahead of the flange; check 'mount' in 'gripper'.",
    )
    ahead = _snap(ahead / np.linalg.norm(ahead), R_flange, _SNAP_AHEAD)
    if gripper.pads is None:
        most = max(geom_reach(model, data, g, ahead) for g in first + second)
        first = [g for g in first if geom_reach(model, data, g, ahead) > most - _TIP_M]
        second = [g for g in second if geom_reach(model, data, g, ahead) > most - _TIP_M]
    require(first and second, f"{rig.path}: one finger is longer than the other; name both 'pads' in 'gripper'.")
    return (first, second), across, ahead


def _snap(direction: Array, R: Array, near: float) -> Array:
    """An axis of a frame where a direction is as good as that, else the direction."""
    along = R.T @ direction
    k = int(np.abs(along).argmax())
    return np.asarray(np.sign(along[k]) * R[:, k] if abs(along[k]) > near else direction)
