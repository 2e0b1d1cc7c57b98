"""The transfer of one part, with what it carries: grips, lines, macros, guards."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.assembly import Operation, Poses
from apo_bench.geometry import Array, pose
from apo_bench.planning.insertion.arrival import Arrival
from apo_bench.planning.insertion.attach import Attach
from apo_bench.planning.insertion.macros import MacroName
from apo_bench.planning.insertion.surroundings import WALL_MARGIN_M
from apo_bench.simulation.robot import move_to_height, translate

_AHEAD_M = 0.01
"""A motion from above is guarded from so far above where it turns slow."""
SAFE_M = 0.15
"""Least height of the tip at which parts are carried over the others."""
_HOVER_M = 0.11
"""How far before a grasp the hand comes to a stand."""
_STRAIGHT = 0.99
_DOWN = float(np.cos(np.radians(10.0)))
ASIDE_M = 0.006
"""A slide begins this far from the side that it will touch; what touches at its side is moved off as far before it is
lifted, since in the hand it drifts into its neighbour."""


PUT_DOWN = Attach(np.array([0.0, 0.0, -1.0]), 0.05)
"""How a part that was taken off is put down, in the world."""


class Grip(NamedTuple):
    """How the gripper holds the part."""

    T_part_tip: Array
    half_width: float
    """Half the part's width between the fingers, [m]."""

    def with_tip_at(self, T: Array) -> "Grip":
        """The grip of a tip that comes to be at T, (4, 4), in the frame of where the robot estimates it."""
        return Grip(self.T_part_tip @ T, self.half_width)


@final
@dataclass(frozen=True, eq=False)
class ApproachLine:
    """A straight way of the part, in the direction in which the part is attached."""

    direction: Array
    """Unit vector of the motion towards the goal, (3,), world."""
    travel: float
    left: float | None = None
    """How far before its end the grip changes, [m]; None if it does not."""

    @property
    def level(self) -> bool:
        return bool(abs(self.direction[2]) < 0.5)


class Motion(NamedTuple):
    """A macro of the plan, as the robot carries it out."""

    name: MacroName
    direction: Array
    """Unit vector, (3,), world."""


@final
@dataclass(frozen=True, eq=False)
class Transfer:
    """What the controller needs to move one part; every pose in the world."""

    part: str
    carried: tuple[str, ...]
    T_world_start: Array
    T_world_goal: Array
    grips: tuple[Grip, ...]
    """In the order of their use; the next one at each change of grip."""
    out: ApproachLine
    """The way out of where it is, as it was once attached there: it is gone backwards."""
    into: ApproachLine
    centring: tuple[Grip, ...]
    """After it was put down, the fingers close and open again here: closing, they centre the part between them."""
    departs: tuple[Motion, ...]
    """The macros by which it leaves its contacts, apart from being lifted."""
    macros: tuple[Motion, ...]
    """The macros by which it comes into its contacts; the first of them goes along `into`."""
    over: float
    """Height of the tip at which the empty hand passes over everything that stands, [m]."""
    safe: float
    """Height of the tip at which the part is carried over everything that stands, [m]."""
    slow: float
    """From this far before the goal a motion from above goes slowly: contact may come any moment, [m]."""
    entrances: tuple[float, ...]
    """So far before the goal the part comes to where walls begin that it goes between, [m]."""
    weight_n: float
    """The weight of the part and what it carries, [N]."""
    place_n: float
    """Guard of a motion onto a support, [N]."""
    insert_n: float
    """Guard of an insertion, below the force at which a neighbour would slide, [N]."""
    slide_n: float
    """Guard of a slide, below the force at which what is touched would slide, [N]."""
    clearance: float
    """What lay free falls by this onto the floor of its slot, [m]."""
    in_last: bool = False
    """Whether a motion from above that comes between the last walls only half of their way is searched on, and not one
    that comes half of the way of all."""
    squaring: tuple[Grip, ...] = ()
    """Before it is taken, the fingers close and open again here, at its start; none without probing."""
    flat: Any = None
    """A `FlatPlacement`: the part laid flat, below where a level insertion begins, or where it stood before one from
    above; None where it cannot or need not."""
    side_touches: tuple[Any, ...] = ()
    """Each a `SideTouch`: where the part touches a wall with its side, before an insertion from above."""
    front: Array | None = None
    """Where the part, with what it carries, ends ahead on its way: the middle of it, in its own frame, (3,), [m]; None
    where a hole is not searched for."""

    @property
    def begins(self) -> float:
        """How far before the goal the guarded motion begins, [m]: straight from above, just before it turns slow."""
        return min(self.into.travel, self.slow + _AHEAD_M) if self.into.direction[2] < -_STRAIGHT else self.into.travel

    @property
    def foremost(self) -> Array:
        """`front`, or the origin of the part where no hole is searched for, (3,), [m]."""
        return np.zeros(3) if self.front is None else self.front

    @property
    def depth(self) -> float:
        """How deep a motion from above goes between walls, [m]."""
        return self.slow - WALL_MARGIN_M

    @property
    def stuck(self) -> float:
        """A motion from above that is stopped farther than this before its end has not found its hole, [m]."""
        return min(self.entrances) / 2 if self.in_last and self.entrances else self.depth / 2

    @property
    def sides(self) -> tuple[Array, ...]:
        """Directions in which the part is slid onto another one at its side, (3,) each."""
        return tuple(macro.direction for macro in self.macros if macro.name == "slide-to-contact")

    @property
    def away(self) -> tuple[Array, ...]:
        """Directions in which the part is first moved off another one at its side, (3,) each."""
        directions = [macro.direction for macro in self.departs]
        return () if self.out.level else tuple(each for each in directions if abs(each[2]) < 0.5)

    @property
    def drawn(self) -> bool:
        """Whether it is drawn up out of walls while it is lifted."""
        return any(macro.direction[2] > 0.5 for macro in self.departs)

    @property
    def floats(self) -> float:
        """How far up a part must be to be free all round: seen at rest it lay on the floor of its slot, [m]."""
        return 0.5 * self.clearance

    def with_tip_at(self, T: Array) -> "Transfer":
        """The transfer with a tip that comes to be at T, (4, 4), in the frame of where the robot estimates it."""
        if np.array_equal(T, np.eye(4)):
            return self
        grips = tuple(grip.with_tip_at(T) for grip in self.grips)
        centring, squaring = (tuple(g.with_tip_at(T) for g in these) for these in (self.centring, self.squaring))
        return replace(self, grips=grips, centring=centring, squaring=squaring)


def compute_transferred_poses(operation: Operation, target: Array, poses: Poses) -> Poses:
    """Where all parts are once the main part of an operation was brought to a pose, (4, 4), with what it carries."""
    T = target @ pose.inverse(poses[operation.main])
    return {**poses, **{part: T @ poses[part] for part in operation.moves}}


def first_contact_pose(t: Transfer) -> Array:
    """Where the part first comes down: at its goal, or aside of what it will touch."""
    return translate(t.T_world_goal, np.sum(t.sides, axis=0), -ASIDE_M) if t.sides else t.T_world_goal


def key_poses(t: Transfer) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    """Tip poses that must be in reach for the transfer to be possible: where the part is taken, and where it is put."""
    first = t.grips[0].T_part_tip
    last = t.grips[-1].T_part_tip
    carrying = t.grips[1 if t.out.left is not None else 0].T_part_tip
    pick = t.T_world_start @ first
    goal = t.T_world_goal @ last
    free = translate(t.T_world_start @ carrying, t.out.direction, -t.out.travel)
    before = translate(t.T_world_goal @ carrying, t.into.direction, -t.into.travel)
    above, over = (move_to_height(T, max(t.safe, T[2, 3])) for T in (free, before))
    return (find_hover_pose(pick), pick, *([free] if t.out.level else []), above), (over, before, goal)


def is_tilted(T_tip: Array) -> bool:
    """Whether a tip does not come from above, as near as parts that stand are upright."""
    return bool(T_tip[2, 2] > -_DOWN)


def find_hover_pose(grasp: Array) -> Array:
    """Where the tip comes to a stand before it goes on to a grasp: above it, of a tilted one straight back."""
    if is_tilted(grasp):
        return translate(grasp, grasp[:3, 2], -_HOVER_M)
    return move_to_height(grasp, float(grasp[2, 3]) + _HOVER_M)


def plan_arrival_line(arrival: Arrival, T: Array) -> ApproachLine:
    """The line on which a part arrives at T; straight down if it touches nothing there that is known of."""
    if not arrival.touched:
        return ApproachLine(PUT_DOWN.direction, PUT_DOWN.travel_m)
    return ApproachLine(T[:3, :3] @ arrival.line.direction, arrival.line.travel_m)


def motions(arrival: Arrival, T: Array, sides: tuple[Array, ...]) -> tuple[Motion, ...]:
    """The macros in the world, for a part that arrives at T; slides as they are estimated to be."""
    straight = [macro for macro in arrival.macros if macro.name != "slide-to-contact"]
    turned = [Motion(macro.name, T[:3, :3] @ arrival.own(macro.direction)) for macro in straight]
    return (*turned, *(Motion("slide-to-contact", side) for side in sides))


def departure_motions(arrival: Arrival, T: Array, sides: tuple[Array, ...]) -> tuple[Motion, ...]:
    """The macros backwards, for a part that leaves T: off its sides, the last first, then out of what encloses it."""
    out = [macro for macro in arrival.departs if macro.length_m is not None]
    drawn = [Motion(macro.name, T[:3, :3] @ arrival.own(macro.direction)) for macro in out]
    return (*(Motion("depart", -side) for side in reversed(sides)), *drawn)
