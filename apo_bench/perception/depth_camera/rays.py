"""The interface of a ray caster, which the simulator implements."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array, Solid

RayCaster = Callable[[Mapping[str, Array], Array, Array], tuple[Array, NDArray[np.int64]]]
"""(poses (4, 4) of some parts, origin (3,), rays (n, 3)) -> how far each ray goes, (n,), infinite where it strikes
nothing, and the number of the part that it strikes, in the order of the poses, -1 for none; world, [m]."""

MakeRayCaster = Callable[[Mapping[str, Solid], float], RayCaster]
"""(models, clearance per side) -> what casts rays at these parts as they are made."""
