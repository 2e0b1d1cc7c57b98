"""How a part came to its goal, beside how the plan brings it there."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.recording.importing import Imported
from apo_bench.recording.paths import Straight, last_straight
from apo_bench.scenario.nominal import nominal_operations

_ALIKE_DEG = 20.0
"""Directions within this are the same."""


class Approach(NamedTuple):
    """The last straight piece of an operation."""

    operation: int
    """Counted from 0."""
    straight: Straight | None
    """None: too short, or too few frames."""
    macro: str
    """The motion of the plan that is nearest in direction."""
    off_deg: float
    """Between the two."""

    @property
    def alike(self) -> bool:
        return self.off_deg <= _ALIKE_DEG


def approaches(found: Imported) -> Sequence[Approach]:
    """Every operation that was seen."""
    made = []
    for k, (one, what) in enumerate(zip(found.operations, nominal_operations(found.scenario), strict=True)):
        if one.path is None or one.rest is None:
            continue
        arrival = what.after
        ways: dict[str, Array] = {macro.name: arrival.own(macro.direction) for macro in arrival.macros}
        ways.setdefault("put down", arrival.line.direction)
        straight = last_straight(one.path, found.camera.T_world_camera @ one.rest.T)
        if straight is None:
            made.append(Approach(k, None, "", 0.0))
            continue
        angles = {
            name: float(np.degrees(np.arccos(np.clip(straight.direction @ way, -1.0, 1.0))))
            for name, way in ways.items()
        }
        nearest = min(angles, key=lambda name: angles[name])
        made.append(Approach(k, straight, nearest, angles[nearest]))
    return made
