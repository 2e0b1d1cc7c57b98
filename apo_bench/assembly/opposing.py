"""Do faces that touch look at each other? The face contact equations do not ask that.

They say that vertices of one face lie in the plane of the other, whichever way the two look: a cube upside down inside
the table satisfies them as well as one that stands on it. Nothing keeps a cone on a rim from tilting, so it may by up
to a right angle; planes through an axis have no sense.
"""

import numpy as np
from numpy.typing import NDArray

from apo_bench.assembly.goals import Poses
from apo_bench.assembly.pattern import pattern
from apo_bench.assembly.topology import Assembly
from apo_bench.geometry.arrays import Array


def looking_away(assembly: Assembly, start: Poses, goals: Array) -> NDArray[np.bool_]:
    """Which contacts have faces that do not look at each other when they are made, (*, c), in the order of
    `relations()`; those of round faces as `lowered` has them.

    Args:
        goals: (*, n, 4, 4), world frame, [m].
    """
    known = pattern(assembly)
    constant = np.array([start[part] for part in assembly.solids]).reshape(-1, 4, 4)[:, :3, :3]
    lead = goals.shape[:-3]
    R = np.concatenate(
        [
            np.broadcast_to(constant, (*lead, *constant.shape)),
            goals[..., :3, :3],
            np.broadcast_to(np.eye(3), (*lead, 1, 3, 3)),
        ],
        axis=-3,
    )
    turned = np.concatenate([R, np.swapaxes(R, -1, -2)], axis=-3)
    rows = known.letters + known.inverse * R.shape[-3]
    n = np.broadcast_to(known.plane[:, None, :3], (*lead, len(rows), 1, 3))
    for j in range(rows.shape[1]):
        n = n @ turned[..., rows[:, j], :, :]
    return np.asarray((n[..., 0, :] * known.onto[:, :3]).sum(axis=-1) > known.opposing)
