"""Macros: the straight motions by which a part comes into its contacts, found by taking them off in thought.

What is taken off last is made first (`peel`). A contact that opens is made by a guarded motion
until it is felt; walls that enclose the part are made by an insertion to a place that must be known before.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, final

import numpy as np

from apo_bench.geometry import Array, copy_frozen
from apo_bench.planning.insertion.states import ANGLE_RAD, Cone, ContactState, classify, evenly_open, null_space

MacroName = Literal[
    "move-to-contact",
    "slide-to-contact",
    "insert-into",
    "insert-between",
    "insert-into-slot",
    "move-to-bottom",
    "depart",
]
_INSERTIONS: tuple[MacroName, ...] = ("insert-into", "insert-between", "insert-into-slot")
UP = np.array([0.0, 0.0, 1.0])
_SMALL = 1e-9


@final
@dataclass(frozen=True, eq=False)
class Macro:
    """One straight motion, in the frame in which the contacts were given."""

    name: MacroName
    direction: Array
    """Unit vector, (3,)."""
    makes: tuple[int, ...]
    """The contacts that are closed when it ends, by number; of `depart` those that it opens."""
    keeps: tuple[int, ...]
    """The contacts made before, along which it goes."""
    length_m: float | None = None
    """How far it goes; None: until contact is felt."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "direction", copy_frozen(np.asarray(self.direction) + 0.0, 3))

    @property
    def inserts(self) -> bool:
        return self.name in _INSERTIONS

    @property
    def guarded(self) -> bool:
        """Whether it ends when contact is felt."""
        return not self.inserts and self.name != "depart"


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


class StraightExit(NamedTuple):
    """A straight way out."""

    direction: Array
    """Unit vector of the motion outwards, (3,)."""
    length_m: float
    """After which the part is free of the walls."""
    free: bool
    """Whether nothing else is in the way."""


_Out = Callable[[Array, tuple[int, ...]], StraightExit]
"""Chooses how a part leaves between walls: the directions in which all stay closed, (m, 3), and the walls by number."""


class Chain(NamedTuple):
    """How a part comes into its contacts."""

    state: ContactState
    """When all are made."""
    macros: tuple[Macro, ...]
    way: StraightExit | None
    """Along which it leaves walls; None if it is enclosed by none, or if it is locked."""
    locked: bool
    """Whether no straight motion leads there."""


def chain(normals: Array, out: _Out, slack: float = ANGLE_RAD) -> Chain:
    """The macros that make contacts with these normals.

    Args:
        normals: From what rests into the free side of what moves, unit length, (k, 3), z upwards.
        out: How the part would leave between walls.
        slack: Sine of the angle within which a direction counts as along a wall.
    """
    layers = peel(normals)
    state = classify(normals).state
    if layers and layers[-1].locked:
        return Chain(state, (), None, True)
    macros: list[Macro] = []
    way: StraightExit | None = None
    for layer in reversed(layers):
        if layer.slides_out:
            way = out(null_space(normals[list(layer.breaks)]), layer.breaks)
            macros.append(_insertion(layer, layers, way))
        else:
            macros += _contacts(normals, layer, slack)
    return Chain(state, tuple(macros), way, False)


def departure(arrival: Chain, supports: tuple[int, ...]) -> tuple[Macro, ...]:
    """The macros by which a part leaves the contacts of a chain: the same ways back, in reverse order.

    A part that only rests on supports is simply lifted, which belongs to every transfer; that is no macro.
    """
    back: list[Macro] = []
    for macro in reversed(arrival.macros):
        d = -macro.direction
        length = macro.length_m
        last = back[-1] if back else None
        if last is not None and last.direction @ d > 1.0 - _SMALL:
            length = max((x for x in (last.length_m, length) if x is not None), default=None)
            back[-1] = Macro("depart", d, (*last.makes, *macro.makes), macro.keeps, length)
        else:
            back.append(Macro("depart", d, macro.makes, macro.keeps, length))
    if back and set(back[-1].makes) <= set(supports):
        back.pop()
    return tuple(back)


def _insertion(layer: Layer, layers: Sequence[Layer], way: StraightExit) -> Macro:
    """The motion between walls: along an axis, with a floor at the end, or between two planes."""
    name: MacroName = "insert-into"
    if layer.cone.state.constraining == 1:
        name = "insert-into-slot" if len(layers) > 1 else "insert-between"
    return Macro(name, -way.direction, layer.breaks, (), way.length_m)


def _contacts(normals: Array, layer: Layer, slack: float) -> list[Macro]:
    """The guarded motions that close what can be opened: down onto what carries first, then sideways, one by one."""
    macros: list[Macro] = []
    left = layer.breaks
    closed_before = layer.keeps
    while left:
        along = null_space(normals[list(closed_before)]) if closed_before else np.eye(3)
        off, closed = _next(normals, left, along, slack)
        if not closed:  # nothing is left to move along, so the rest closes with what was made last
            return _together(normals, layer, macros, left)
        name: MacroName = "slide-to-contact" if macros else "move-to-contact"
        if layer.cone.state.constraining == 2:
            name = "move-to-bottom"
        macros.append(Macro(name, -off, closed, closed_before))
        closed_before = (*closed_before, *closed)
        left = tuple(i for i in left if i not in closed)
    return macros


def _together(normals: Array, layer: Layer, macros: list[Macro], left: tuple[int, ...]) -> list[Macro]:
    """Motions of which the last closes what is left, too: turned where that would leave a wall, else one for all."""
    last = macros[-1]
    makes = (*last.makes, *left)
    off = -last.direction
    if (normals[list(left)] @ off <= 0.0).any():
        off = _evenly_off(normals, makes, last.keeps)
        if not off.any():
            return [replace(macros[0], direction=-_evenly_off(normals, layer.breaks, layer.keeps), makes=layer.breaks)]
    return [*macros[:-1], replace(last, direction=-off, makes=makes)]


def _evenly_off(normals: Array, makes: Sequence[int], keeps: Sequence[int]) -> Array:
    """The direction that opens some contacts best while others stay closed, (3,); zero if there is none."""
    along = null_space(normals[list(keeps)]) if keeps else np.eye(3)
    return np.asarray(evenly_open(normals[list(makes)] @ along.T) @ along)


def _next(normals: Array, left: Sequence[int], along: Array, slack: float) -> tuple[Array, tuple[int, ...]]:
    """In which direction some contacts open while those made before stay closed, and which: up, if that opens any and
    leads into none."""
    up = _along(UP, along)
    opened = normals[list(left)] @ up
    carried = tuple(i for i, rate in zip(left, opened, strict=True) if rate > slack)
    if up[2] > 0.5 and carried and (opened >= -slack).all():
        return up, carried
    for i in sorted(left, key=lambda i: -max(0.5, round(float(normals[i] @ UP), 6))):
        off = _along(normals[i], along)
        if off.any():
            return off, tuple(j for j in left if normals[j] @ normals[i] > 1.0 - slack)
    return np.zeros(3), ()


def _along(direction: Array, along: Array) -> Array:
    """The part of a direction that lies in the span of an orthonormal basis, (m, 3), as a unit vector, or zero."""
    within = direction if len(along) == 3 else along.T @ (along @ direction)
    size = float(np.linalg.norm(within))
    if size < 1e-6:
        return np.zeros(3)
    within = np.round(within / size, 12) + 0.0
    return np.asarray(within / np.linalg.norm(within))
