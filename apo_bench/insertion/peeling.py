"""Peeling: in which order the contacts of a part can be taken off, which read backwards is how they are made."""

from typing import NamedTuple

import numpy as np

from apo_bench.geometry.arrays import Array
from apo_bench.insertion.states import Cone, classify


class Layer(NamedTuple):
    """The contacts that one motion takes off, by their row numbers."""

    cone: Cone
    """The cone of all contacts that are left before the motion."""
    breaks: tuple[int, ...]
    keeps: tuple[int, ...]
    """Walls along which the motion goes."""

    @property
    def slides_out(self) -> bool:
        """Nothing can be opened, but there is a direction along all walls: the part is drawn out until they end."""
        return not self.cone.state.detaching

    @property
    def locked(self) -> bool:
        return not self.cone.state.detaching and not self.cone.state.maintaining


def peel(rows: Array) -> tuple[Layer, ...]:
    """The layers of contacts with these normals, (k, 3), from the one that comes off first; the last may be locked.

    What can be opened is opened first, along walls that stay; walls on all sides are left at their end.
    """
    left = np.arange(len(rows))
    layers = []
    while len(left):
        cone = classify(rows[left])
        off = cone.detachable if cone.state.detaching else np.ones(len(left), dtype=np.bool_)
        layers.append(Layer(cone, tuple(left[off].tolist()), tuple(left[~off].tolist())))
        left = left[~off]
    return tuple(layers)
