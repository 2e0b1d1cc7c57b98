"""Macros: the straight motions by which a part comes into its contacts, found by planning its disassembly
(`peel_contacts`).

The contact that disassembly opens last is made first. Contacts that can open are made by a guarded motion, which ends
when contact is detected. Walls that enclose the part are made by an insertion to a known position.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, final

import numpy as np

from apo_bench.geometry import Array, copy_frozen
from apo_bench.planning.insertion.contact_states import (
    ANGLE_RAD,
    Cone,
    ContactState,
    classify_motions,
    compute_null_space,
    find_even_opening,
)

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
"""Two motions have the same direction if their cosine is above 1 - this."""


@final
@dataclass(frozen=True, eq=False)
class Macro:
    """One straight motion, in the frame of the contact normals."""

    name: MacroName
    direction: Array
    """Unit vector, (3,)."""
    makes: tuple[int, ...]
    """Numbers of the contacts that the motion closes at its end; for `depart`, of those that it opens."""
    keeps: tuple[int, ...]
    """Numbers of the contacts made before, which stay closed during the motion."""
    length_m: float | None = None
    """Length of the motion; None: until contact is detected."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "direction", copy_frozen(np.asarray(self.direction) + 0.0, 3))

    @property
    def inserts(self) -> bool:
        return self.name in _INSERTIONS

    @property
    def guarded(self) -> bool:
        """Whether the motion ends when contact is detected."""
        return not self.inserts and self.name != "depart"


class Layer(NamedTuple):
    """The contacts that one disassembly motion removes, by row number."""

    cone: Cone
    """The motions that all contacts left before this one admit."""
    breaks: tuple[int, ...]
    """Contacts that the motion removes."""
    keeps: tuple[int, ...]
    """Walls along which the motion goes; they stay closed."""

    @property
    def slides_out(self) -> bool:
        """Whether no contact can open, so the part slides along all walls until they end; also true if locked."""
        return not self.cone.state.detaching

    @property
    def locked(self) -> bool:
        """Whether the contacts admit no motion at all."""
        return not self.cone.state.detaching and not self.cone.state.maintaining


def peel_contacts(rows: Array) -> tuple[Layer, ...]:
    """Sort contacts with normals `rows`, (k, 3), into layers, from the one that disassembly removes first.

    Contacts that can open come first, while the others stay closed. If none can open, all that are left make one layer.
    That last layer may be locked.
    """
    left = np.arange(len(rows))
    layers = []
    while len(left):
        cone = classify_motions(rows[left])
        off = cone.detachable if cone.state.detaching else np.ones(len(left), dtype=np.bool_)
        layers.append(Layer(cone, tuple(left[off].tolist()), tuple(left[~off].tolist())))
        left = left[~off]
    return tuple(layers)


class StraightExit(NamedTuple):
    """A straight motion by which a part leaves the walls around its goal."""

    direction: Array
    """Unit vector of the motion outwards, (3,)."""
    length_m: float
    """Distance after which the part is free of the walls."""
    free: bool
    """Whether nothing else is in the way."""


_FindExit = Callable[[Array, tuple[int, ...]], StraightExit]
"""Chooses the exit of a part between walls.

Arguments: orthonormal directions in which all walls stay closed, (m, 3); numbers of the walls.
"""


class MacroChain(NamedTuple):
    """The macros by which a part comes into its contacts."""

    state: ContactState
    """The contact state once all contacts are made."""
    macros: tuple[Macro, ...]
    way: StraightExit | None
    """The exit from enclosing walls; None if no walls enclose the part, or if it is locked."""
    locked: bool
    """Whether no straight motion leads into the contacts."""


def build_macro_chain(normals: Array, out: _FindExit, slack: float = ANGLE_RAD) -> MacroChain:
    """The macros that make contacts with these normals.

    Args:
        normals: Unit normals from the resting part towards the moving one, (k, 3), z upwards.
        out: Chooses the exit of the part between walls.
        slack: Sine of the angle within which a direction counts as along a wall.
    """
    layers = peel_contacts(normals)
    state = classify_motions(normals).state
    if layers and layers[-1].locked:
        return MacroChain(state, (), None, True)
    macros: list[Macro] = []
    way: StraightExit | None = None
    for layer in reversed(layers):
        if layer.slides_out:
            way = out(compute_null_space(normals[list(layer.breaks)]), layer.breaks)
            macros.append(_name_insertion(layer, layers, way))
        else:
            macros += _list_contact_macros(normals, layer, slack)
    return MacroChain(state, tuple(macros), way, False)


def invert_macros(arrival: MacroChain, supports: tuple[int, ...]) -> tuple[Macro, ...]:
    """The macros by which a part leaves its contacts: the arrival's motions inverted, in reverse order.

    A final lift off supports alone is part of every transfer, so it is left out.

    Args:
        supports: Numbers of the contacts that carry the part.
    """
    back: list[Macro] = []
    for macro in reversed(arrival.macros):
        d = -macro.direction
        length = macro.length_m
        last = back[-1] if back else None
        if last is not None and last.direction @ d > 1.0 - _SMALL:
            # Consecutive motions in one direction become one; a known length wins over None.
            length = max((x for x in (last.length_m, length) if x is not None), default=None)
            back[-1] = Macro("depart", d, (*last.makes, *macro.makes), macro.keeps, length)
        else:
            back.append(Macro("depart", d, macro.makes, macro.keeps, length))
    # Only supports open in the last motion, so it is the lift of the transfer.
    if back and set(back[-1].makes) <= set(supports):
        back.pop()
    return tuple(back)


def _name_insertion(layer: Layer, layers: Sequence[Layer], way: StraightExit) -> Macro:
    """The insertion between the walls of a layer: a peg into a hole, into a slot with a bottom, or between two planes.

    Args:
        layers: All layers; with more than one, the slot has further contacts, such as its bottom.
        way: The exit; the insertion goes the opposite way.
    """
    name: MacroName = "insert-into"
    # Only one direction is constrained: parallel planes rather than a hole.
    if layer.cone.state.constraining == 1:
        name = "insert-into-slot" if len(layers) > 1 else "insert-between"
    return Macro(name, -way.direction, layer.breaks, (), way.length_m)


def _list_contact_macros(normals: Array, layer: Layer, slack: float) -> list[Macro]:
    """The guarded motions that close the contacts of a layer, one by one: down onto supports first, then sideways."""
    macros: list[Macro] = []
    left = layer.breaks
    closed_before = layer.keeps
    while left:
        along = compute_null_space(normals[list(closed_before)]) if closed_before else np.eye(3)
        off, closed = _find_next_contacts(normals, left, along, slack)
        if not closed:  # nothing is left to move along, so the rest closes with what was made last
            return _merge_into_last(normals, layer, macros, left)
        name: MacroName = "slide-to-contact" if macros else "move-to-contact"
        if layer.cone.state.constraining == 2:
            # Walls in two directions: the motion ends at the bottom of a hole.
            name = "move-to-bottom"
        macros.append(Macro(name, -off, closed, closed_before))
        closed_before = (*closed_before, *closed)
        left = tuple(i for i in left if i not in closed)
    return macros


def _merge_into_last(normals: Array, layer: Layer, macros: list[Macro], left: tuple[int, ...]) -> list[Macro]:
    """`macros` with the last one changed so that it also closes the contacts `left`.

    If its direction would press into one of them, it turns to a direction that closes all evenly. If no such direction
    exists, one macro closes all contacts of the layer.
    """
    last = macros[-1]
    makes = (*last.makes, *left)
    off = -last.direction
    if (normals[list(left)] @ off <= 0.0).any():
        off = _find_opening_direction(normals, makes, last.keeps)
        if not off.any():
            return [
                replace(
                    macros[0],
                    direction=-_find_opening_direction(normals, layer.breaks, layer.keeps),
                    makes=layer.breaks,
                )
            ]
    return [*macros[:-1], replace(last, direction=-off, makes=makes)]


def _find_opening_direction(normals: Array, makes: Sequence[int], keeps: Sequence[int]) -> Array:
    """The unit direction, (3,), that opens `makes` the fastest while `keeps` stay closed; zero if there is none."""
    along = compute_null_space(normals[list(keeps)]) if keeps else np.eye(3)
    return np.asarray(find_even_opening(normals[list(makes)] @ along.T) @ along)


def _find_next_contacts(
    normals: Array, left: Sequence[int], along: Array, slack: float
) -> tuple[Array, tuple[int, ...]]:
    """The direction, (3,), that opens the next contacts while those made before stay closed, and the numbers of these.

    Straight up is preferred if that opens a contact and presses into none. Otherwise the normal of a contact is taken,
    the most upward ones first. The result is (zero, ()) if nothing can open.

    Args:
        left: Numbers of the contacts not made yet.
        along: Orthonormal basis of the directions in which earlier contacts stay closed, (m, 3).
        slack: Sine of the angle within which a direction counts as along a wall.
    """
    up = _project_to_span(UP, along)
    opened = normals[list(left)] @ up
    carried = tuple(i for i, rate in zip(left, opened, strict=True) if rate > slack)
    if up[2] > 0.5 and carried and (opened >= -slack).all():
        return up, carried
    # Normals with z below 0.5 rank alike, in their given order.
    for i in sorted(left, key=lambda i: -max(0.5, round(float(normals[i] @ UP), 6))):
        off = _project_to_span(normals[i], along)
        if off.any():
            return off, tuple(j for j in left if normals[j] @ normals[i] > 1.0 - slack)
    return np.zeros(3), ()


def _project_to_span(direction: Array, along: Array) -> Array:
    """The projection of a direction, (3,), onto the span of orthonormal rows, (m, 3), as unit vector; zero if tiny."""
    within = direction if len(along) == 3 else along.T @ (along @ direction)
    size = float(np.linalg.norm(within))
    if size < 1e-6:
        return np.zeros(3)
    within = np.round(within / size, 12) + 0.0
    return np.asarray(within / np.linalg.norm(within))
