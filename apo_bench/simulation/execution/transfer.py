"""The transfer of one part and the parts that it carries: the grips, approach lines, macros and guards."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple, final

import numpy as np

from apo_bench.assembly import Operation, Poses
from apo_bench.geometry import Array, pose
from apo_bench.planning.insertion.arrival import Arrival
from apo_bench.planning.insertion.attach_line import Attach
from apo_bench.planning.insertion.insertion_geometry import WALL_MARGIN_M
from apo_bench.planning.insertion.macros import MacroName
from apo_bench.simulation.robot import move_to_height, translate

_AHEAD_M = 0.01
"""Distance above the slow stretch at which the guarded motion from above begins."""
SAFE_M = 0.15
"""Least height of the tip at which parts are carried over the others."""
_HOVER_M = 0.11
"""Distance before a grasp at which the hand stops."""
_STRAIGHT = 0.99  # downward component from which a direction counts as straight down
_DOWN = float(np.cos(np.radians(10.0)))  # downward component below which a tip counts as tilted
ASIDE_M = 0.006
"""Distance from the touched side at which a slide begins.

A part that touches another at its side is moved off by the same distance before it is lifted. Otherwise it may drift
against its neighbour in the hand.
"""


PUT_DOWN = Attach(np.array([0.0, 0.0, -1.0]), 0.05)
"""Straight down, in the world: how a part is put down that touches nothing known, or whose operation is undone."""


class Grip(NamedTuple):
    """The pose of the tip at a part, and the opening at which the fingers touch it."""

    T_part_tip: Array
    """Pose of the tip in the frame of the part, (4, 4)."""
    half_width: float
    """Half the part's width between the fingers, [m]."""

    def with_tip_at(self, T: Array) -> "Grip":
        """Return the grip of a robot whose real tip is at T, (4, 4), in the frame of the estimated tip."""
        return Grip(self.T_part_tip @ T, self.half_width)


@final
@dataclass(frozen=True, eq=False)
class ApproachLine:
    """A straight motion of the part, in the direction in which it is attached."""

    direction: Array
    """Unit vector of the motion towards the goal, (3,), world."""
    travel: float
    """Length of the motion, [m]."""
    left: float | None = None
    """Distance before its end at which the grip changes, [m]; None if it does not."""

    @property
    def level(self) -> bool:
        """Whether the direction is nearer to level than to vertical."""
        return bool(abs(self.direction[2]) < 0.5)


class Motion(NamedTuple):
    """A macro of the plan with its direction in the world."""

    name: MacroName
    direction: Array
    """Unit vector, (3,), world."""


@final
@dataclass(frozen=True, eq=False)
class Transfer:
    """Everything that the controller needs to move one part; all poses in the world."""

    part: str
    carried: tuple[str, ...]
    """The parts that move with it."""
    T_world_start: Array
    T_world_goal: Array
    grips: tuple[Grip, ...]
    """In the order of their use; the next one at each change of grip."""
    out: ApproachLine
    """The line on which the part was once attached at its start; it leaves along it backwards."""
    into: ApproachLine
    """The line to the goal."""
    centring: tuple[Grip, ...]
    """Grips in which the fingers close and open after the part was placed, to centre it between them."""
    departs: tuple[Motion, ...]
    """The macros by which the part leaves its contacts, apart from being lifted."""
    macros: tuple[Motion, ...]
    """The macros by which the part makes its contacts; the first of them is along `into`."""
    over: float
    """Height of the tip at which the empty hand passes over all parts, [m]."""
    safe: float
    """Height of the tip at which the part is carried over all others, [m]."""
    slow: float
    """Distance before the goal from which a motion from above is slow, since contact may come, [m]."""
    entrances: tuple[float, ...]
    """Distances before the goal at which the part enters between walls, [m], the farthest first."""
    weight_n: float
    """Weight of the part and the parts that it carries, [N]."""
    place_n: float
    """Force limit of a motion onto a support, [N]."""
    insert_n: float
    """Force limit of an insertion, below the force at which a neighbour would slide, [N]."""
    slide_n: float
    """Force limit of a slide, below the force at which the touched part would slide, [N]."""
    clearance: float
    """Clearance of the fits, [m]: the distance by which a free part falls onto the floor of its slot."""
    in_last: bool = False
    """How deep a motion from above must come to count as inserted (`stuck`).

    True: half of the way between the last walls. False: half of the way between all walls.
    """
    squaring: tuple[Grip, ...] = ()
    """Grips at the start in which the fingers close and open before the pick; none without probing."""
    flat: Any = None
    """A `FlatPlacement`, at which the part is laid flat before its insertion; None if it is not."""
    side_touches: tuple[Any, ...] = ()
    """`SideTouch` each: touches of a wall with the side of the part, before an insertion from above."""
    clamps_to: str = ""
    """The part to which the part is clamped once it presses on its seat; empty if it is not clamped."""
    lands: bool = True
    """Whether another part carries it at its goal, so that a level motion ends by lowering it."""
    roofed: bool = False
    """Whether it touches a face above it at its goal, so that it must not be too high there."""
    front: Array | None = None
    """Foremost point of the moved parts on the way to the goal, in the frame of the part, (3,), [m]; None if the robot
    does not search for the hole."""

    @property
    def begins(self) -> float:
        """Distance before the goal at which the guarded motion begins, [m].

        Straight from above this is just before the slow stretch, else the begin of the line.
        """
        return min(self.into.travel, self.slow + _AHEAD_M) if self.into.direction[2] < -_STRAIGHT else self.into.travel

    @property
    def presses(self) -> bool:
        """Whether a level motion goes on to a contact at its end: that of a bottom, or the seat of a clamped part."""
        return bool(self.clamps_to) or any(macro.name == "move-to-bottom" for macro in self.macros)

    @property
    def foremost(self) -> Array:
        """`front`, or the origin of the part where no hole is searched for, (3,), [m]."""
        return np.zeros(3) if self.front is None else self.front

    @property
    def depth(self) -> float:
        """Length of a motion from above between walls, [m]."""
        return self.slow - WALL_MARGIN_M

    @property
    def stuck(self) -> float:
        """Distance before its end, [m]; a motion from above that stops farther away has not found its hole."""
        return min(self.entrances) / 2 if self.in_last and self.entrances else self.depth / 2

    @property
    def sides(self) -> tuple[Array, ...]:
        """Directions in which the part is slid against others at its sides, (3,) each, world."""
        return tuple(macro.direction for macro in self.macros if macro.name == "slide-to-contact")

    @property
    def away(self) -> tuple[Array, ...]:
        """Directions in which the part is moved off others at its sides before it is lifted, (3,) each, world."""
        directions = [macro.direction for macro in self.departs]
        return () if self.out.level else tuple(each for each in directions if abs(each[2]) < 0.5)

    @property
    def drawn(self) -> bool:
        """Whether the part is drawn up out of walls while it is lifted."""
        return any(macro.direction[2] > 0.5 for macro in self.departs)

    @property
    def floats(self) -> float:
        """Height by which a part that was observed on the floor of its slot must rise to be free on all sides, [m]."""
        return 0.5 * self.clearance if self.lands or not self.roofed else 0.0

    def with_tip_at(self, T: Array) -> "Transfer":
        """Return the transfer of a robot whose real tip is at T, (4, 4), in the frame of the estimated tip."""
        if np.array_equal(T, np.eye(4)):
            return self
        grips = tuple(grip.with_tip_at(T) for grip in self.grips)
        centring, squaring = (tuple(g.with_tip_at(T) for g in these) for these in (self.centring, self.squaring))
        return replace(self, grips=grips, centring=centring, squaring=squaring)


def compute_transferred_poses(operation: Operation, target: Array, poses: Poses) -> Poses:
    """Return the poses of all parts after an operation has moved its main part to `target`, (4, 4).

    The parts that it carries move with it as one rigid body.
    """
    T = target @ pose.inverse(poses[operation.main])
    return {**poses, **{part: T @ poses[part] for part in operation.moves}}


def first_contact_pose(t: Transfer) -> Array:
    """Return the pose of the part, (4, 4), where it first comes down: the goal, or `ASIDE_M` off the sides to touch."""
    return translate(t.T_world_goal, np.sum(t.sides, axis=0), -ASIDE_M) if t.sides else t.T_world_goal


def key_poses(t: Transfer) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    """Return the tip poses that must be in reach for a transfer, (4, 4) each.

    Returns:
        Those at the start (hover, grasp, pulled out if the line is level, above) and those at the goal (above, begin of
        the line, goal).
    """
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
    """Whether the z axis of a tip is more than 10 degrees off straight down."""
    return bool(T_tip[2, 2] > -_DOWN)


def find_hover_pose(grasp: Array) -> Array:
    """Return the tip pose at which the hand stops before a grasp, (4, 4): above, or straight back if tilted."""
    if is_tilted(grasp):
        return translate(grasp, grasp[:3, 2], -_HOVER_M)
    return move_to_height(grasp, float(grasp[2, 3]) + _HOVER_M)


def plan_arrival_line(arrival: Arrival, T: Array) -> ApproachLine:
    """Return the line on which a part arrives at T; straight down if it has no known contact there."""
    if not arrival.touched:
        return ApproachLine(PUT_DOWN.direction, PUT_DOWN.travel_m)
    return ApproachLine(T[:3, :3] @ arrival.line.direction, arrival.line.travel_m)


def motions(arrival: Arrival, T: Array, sides: tuple[Array, ...]) -> tuple[Motion, ...]:
    """Return the macros of an arrival at T with their directions in the world: first all others, then the slides.

    Args:
        sides: Directions of the slides, (3,) each, world, from `list_slide_directions`.
    """
    straight = [macro for macro in arrival.macros if macro.name != "slide-to-contact"]
    turned = [Motion(macro.name, T[:3, :3] @ arrival.to_part_frame(macro.direction)) for macro in straight]
    return (*turned, *(Motion("slide-to-contact", side) for side in sides))


def departure_motions(arrival: Arrival, T: Array, sides: tuple[Array, ...]) -> tuple[Motion, ...]:
    """Return the motions by which a part leaves T: off its sides in the reverse order, then out of enclosing walls.

    Args:
        sides: Directions of the slides, (3,) each, world, from `list_slide_directions`.
    """
    out = [macro for macro in arrival.departs if macro.length_m is not None]
    drawn = [Motion(macro.name, T[:3, :3] @ arrival.to_part_frame(macro.direction)) for macro in out]
    return (*(Motion("depart", -side) for side in reversed(sides)), *drawn)
