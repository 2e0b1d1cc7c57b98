"""The interface of a ray caster: the perception uses it, the simulator implements it."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from apo_bench.geometry import Array, Solid

RayCaster = Callable[[Mapping[str, Array], Array, Array], tuple[Array, NDArray[np.int64]]]
"""(poses (4, 4) of some parts, origin (3,), rays (n, 3)) -> (distances (n,), indices (n,)); world, [m].

The distance is infinite if a ray hits nothing. The index is that of the hit part, in the order of the poses; -1 for
none.
"""

MakeRayCaster = Callable[[Mapping[str, Solid], float], RayCaster]
"""(solids by part, clearance per side [m]) -> ray caster for these parts as they are made, smaller by the clearance."""
