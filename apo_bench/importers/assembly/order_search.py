"""Find an assembly order by disassembly: remove parts from the finished assembly, then reverse the removals.

A part can be removed if two conditions hold: the straight path out of its contacts is free, also for the hand above;
and the part would rest stably when put back. If no single part can be removed, a connected group is removed as a sub-
assembly, which is put together next to the assembly first.
"""

from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, combinations
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import Assembly, Contact, ContactMeasurements, Operation, Poses
from apo_bench.geometry import Array, PosedPieces, Solid, is_path_free, measure_extent, pose
from apo_bench.importers.assembly.contact_search import find_contacts
from apo_bench.importers.assembly.posed_parts import TABLE
from apo_bench.importers.assembly.staging import find_stance
from apo_bench.planning.insertion.arrival import Arrival, plan_arrival
from apo_bench.planning.insertion.attach_line import Preference
from apo_bench.planning.insertion.macros import UP
from apo_bench.planning.prediction.stability import BALANCED, measure_imbalance

_FALLS_M = 7.5e-4
"""A part is carried if another one stops it on this way down: a part in a hole drops by its play."""
_CARRIES = 1e-3
"""A contact carries weight if the vertical component of its normal is at least this."""
_SAME = 1e-6  # directions whose cosine differs from 1 by less are equal
_SEAT = 0.5
"""A face ends an insertion if the cosine of its normal with the opposite of the direction is at least this."""
_MOST_SETS = 100
"""The search ends after this number of sets of parts without an order."""
_LARGEST_GROUP = 4  # parts in a sub-assembly
_CARRIED = 3
"""Tests that a part has passed which stays at its place, whether or not it can leave."""


class RemovalObstacle(NamedTuple):
    """Why a part cannot be removed."""

    passed: int
    """How many tests of `_plan_removal` the part passed, 0 to 3."""
    reason: str


class Placement(NamedTuple):
    """One operation of the order that was found."""

    moves: tuple[str, ...]
    """The moved parts: the main part, which is held, then the carried ones."""
    contacts: tuple[Contact, ...]
    """Contacts between moved parts and the others, the face of the moved part first."""
    at: Array
    """(4, 4), goal of the main part in the frame of the assembly, [m]."""
    why: str
    """The reason as a phrase: the direction of insertion and the parts that carry the main part."""
    clamped: bool = False
    """Whether only fasteners, which are no parts, hold the main part."""
    along: Array | None = None
    """Direction of insertion to state, frame of the main part, (3,); None: the planner's own choice."""
    from_above: bool = True
    """Whether the main part comes nearly straight down."""


def _always(part: str, there: Sequence[str]) -> bool:
    """There is room for any gripper."""
    return True


@final
@dataclass
class OrderSearch:
    """Depth-first search for an assembly order, which remembers failed sets of parts and why parts were stuck."""

    solids: Mapping[str, Solid]
    """All parts by name, the table too."""
    poses: Poses  # final poses
    contacts: tuple[Contact, ...]
    aside: Array
    """(3,), offset from the assembly to the place of sub-assemblies, horizontal, [m]."""
    wanted: Sequence[str] = ()
    """The moved parts in the wanted order, which is followed where possible."""
    held: Container[str] = ()
    """Parts that fasteners hold: where nothing carries one of them, it is clamped."""
    has_room: Callable[[str, Sequence[str]], bool] = _always
    """Whether the gripper has room to hold a part at its place among the parts that are there."""
    failed: set[frozenset[str]] = field(default_factory=set)  # sets of parts that have no order
    obstacles: dict[str, RemovalObstacle] = field(default_factory=dict)
    """Part -> its obstacle in the attempt in which it passed most tests."""
    left: frozenset[str] = frozenset()
    """The smallest set of parts reached of which none could be removed."""

    def find(self, fixed: frozenset[str]) -> tuple[Placement, ...] | None:
        """Return the operations that assemble all parts in order; None if there is no such order."""
        return self._order_removals(frozenset(self.solids), fixed | {TABLE})

    def describe_stuck_parts(self) -> list[str]:
        """Return one sentence for each part of the smallest stuck set: why the part cannot be removed."""
        return [obstacle.reason for part, obstacle in self.obstacles.items() if part in self.left]

    def _order_removals(self, there: frozenset[str], base: frozenset[str]) -> tuple[Placement, ...] | None:
        """Return the operations that lead from `base` to the parts in `there`; None if there is no order."""
        if there == base:
            return ()
        if there in self.failed or len(self.failed) > _MOST_SETS:
            return None
        for placing in self._list_removable(there, base):
            before = self._order_removals(there - set(placing.moves), base)
            if before is not None:
                # Never None here: `_list_removable` tests it.
                beside = self._can_preassemble(placing.moves) if len(placing.moves) > 1 else None
                return (*before, *(beside or ()), placing)
        self.failed.add(there)
        return None

    def _list_removable(self, there: frozenset[str], base: frozenset[str]) -> Iterator[Placement]:
        """Yield the possible removals, the best first; groups only if no single part can be removed.

        Args:
            there: The parts that are assembled, the base too.
            base: Parts that never leave.
        """
        free = [part for part in self.solids if part in there - base]
        single = []
        falling = []
        for part in free:
            found = self._plan_removal((part,), there)
            if isinstance(found, Placement):
                single.append(found)
                continue
            if found.passed >= self.obstacles.get(part, found).passed:
                self.obstacles[part] = found
            if found.passed < _CARRIED and (part not in self.held or not found.passed):
                falling.append(part)
        if falling:  # what falls among these parts falls among fewer, too
            self._note_stuck(falling)
            return
        if single:
            yield from sorted(single, key=lambda placing: self._removal_priority(placing, there))
            return
        large_first = sorted(free, key=lambda part: -self.solids[part].volume)
        for group in chain.from_iterable(combinations(large_first, size) for size in range(2, _LARGEST_GROUP + 1)):
            placing = self._plan_removal(group, there) if self._is_connected(group) else None
            if isinstance(placing, Placement) and self._can_preassemble(group) is not None:
                yield placing
        # Reached if no group led to an order either.
        self._note_stuck(free)

    def _note_stuck(self, parts: Sequence[str]) -> None:
        """Remember the smallest stuck set for the error message."""
        if not self.left or len(parts) < len(self.left):
            self.left = frozenset(parts)

    def _removal_priority(self, placing: Placement, there: frozenset[str]) -> tuple[float, ...]:
        """Return the sort key of a removal; the smallest is removed first, thus assembled last.

        Parts late in the wanted order come first, then those with room for the gripper, insertions from above, the
        highest, the smallest.
        """
        part = placing.moves[0]
        low, _ = measure_extent(self.solids[part].pieces, self.poses[part][2, :3])
        return (
            -self.wanted.index(part) if part in self.wanted else 0,
            not self.has_room(part, sorted(there)),
            not placing.from_above,
            -round(low + float(self.poses[part][2, 3]), 4),
            self.solids[part].volume,
        )

    def _plan_removal(self, moves: Sequence[str], there: frozenset[str]) -> Placement | RemovalObstacle:
        """Return the operation that adds `moves` last to the other parts in `there`, or the obstacle.

        Args:
            moves: The parts that leave together, the main part first.
            there: The parts that are assembled, `moves` too.
        """
        rest = [part for part in self.solids if part in there and part not in moves]
        main = moves[0]
        poses = self.poses
        # Contacts of moved parts with the others, the moved face first.
        pairs = (pair for a, b in self.contacts for pair in ((a, b), (b, a)))
        contacts = tuple(Contact(a, b) for a, b in pairs if a.part in moves and b.part in rest)
        others = ", ".join(dict.fromkeys(of.part for contact in contacts for of in contact if of.part in rest))
        assembly = Assembly({part: self.solids[part] for part in (*moves, *rest)}, (), frozenset())
        if not contacts:
            return RemovalObstacle(0, f"'{main}' touches nothing that would be there before it")
        # Then the contact macros give a straight path, which must be free.
        falls = self._find_fall(moves, rest, contacts, assembly, others)
        if falls is not None and main not in self.held:
            return falls
        arrival = plan_arrival(assembly, moves, contacts, poses)
        if falls is None and all(each.normal @ UP < _CARRIES for each in arrival.touched):
            falls = RemovalObstacle(2, f"'{main}' would only touch upright walls of {others}, so nothing carries it")
        if falls is not None:
            seated = self._find_seated_arrival(assembly, moves, contacts, arrival) if main in self.held else None
            if seated is None:
                return falls
            arrival = seated
        if not arrival.free:
            return RemovalObstacle(3, f"'{main}' cannot leave {others}")
        way = poses[main][:3, :3] @ arrival.line.direction  # direction of insertion, world
        along = f"along ({', '.join(f'{x:.3g}' for x in np.round(way, 3) + 0.0)})"
        from_above = bool(way[2] < -0.9)
        direction = "from above" if from_above else "from below" if way[2] > 0.9 else along
        stated = None if falls is None else arrival.line.direction
        why = f"comes {direction}, onto {others}"
        return Placement(tuple(moves), contacts, poses[main], why, falls is not None, stated, from_above)

    def _find_fall(
        self, moves: Sequence[str], rest: Sequence[str], contacts: tuple[Contact, ...], assembly: Assembly, others: str
    ) -> RemovalObstacle | None:
        """Return why parts that are put back would fall; None if another part is below, and their weight over it.

        Args:
            rest: The other parts that are assembled.
            others: Those that the moved parts touch, for the reason.
        """
        main = moves[0]
        poses = self.poses
        above, below = ([PosedPieces(self.solids[part].pieces, poses[part]) for part in of] for of in (moves, rest))
        if is_path_free(above, -UP, _FALLS_M, below):
            return RemovalObstacle(1, f"nothing is below '{main}' that would carry it")
        operation = Operation(main, contacts, tuple(moves[1:]))
        if measure_imbalance(ContactMeasurements(assembly), operation, poses) <= BALANCED:
            return None
        return RemovalObstacle(2, f"'{main}' would not keep its balance on {others}, which would be there before it")

    def _find_seated_arrival(
        self, assembly: Assembly, moves: Sequence[str], contacts: tuple[Contact, ...], first: Arrival
    ) -> Arrival | None:
        """Return an arrival that ends on a face, so that the robot feels when a part that is clamped is in place.

        Args:
            first: The arrival without a preferred direction.
        """
        R = first.T[:3, :3]
        ways = [R @ first.line.direction, *(-each.normal for each in first.touched)]
        for way in ways:
            if all(each.normal @ way > -_SEAT for each in first.touched):
                continue  # nothing stops the part
            arrival = plan_arrival(assembly, moves, contacts, self.poses, Preference(R.T @ way))
            if arrival.free and R @ arrival.line.direction @ way > 1.0 - _SAME:
                return arrival
        return None

    def _can_preassemble(self, group: tuple[str, ...]) -> tuple[Placement, ...] | None:
        """Return the operations that assemble a group next to the assembly, its main part on the table.

        None if the main part does not stand stably on the table, or if the group has no order.
        """
        main = group[0]
        stance = find_stance(self.solids[main], self.poses[main][:3, :3])
        if not stance.stands or stance.rolls:
            return None
        # The same search for the group alone, on the table, each part at its place in the group.
        shift = pose.at(self.aside + np.array([0.0, 0.0, stance.height_m - float(self.poses[main][2, 3])]))
        poses = {part: shift @ self.poses[part] for part in group} | {TABLE: self.poses[TABLE]}
        solids = {part: self.solids[part] for part in (*group, TABLE)}
        inner = OrderSearch(solids, poses, find_contacts(solids, poses), self.aside, held=self.held)
        base = frozenset((main, TABLE))
        first = inner._plan_removal((main,), base)
        rest = inner._order_removals(frozenset(solids), base)
        return None if rest is None or not isinstance(first, Placement) else (first, *rest)

    def _is_connected(self, group: Sequence[str]) -> bool:
        """Whether contacts within the group connect each part of the group to the first one."""
        known = {group[0]}
        for _ in group:
            for a, b in self.contacts:
                if {a.part, b.part} <= set(group) and known & {a.part, b.part}:
                    known |= {a.part, b.part}
        return known == set(group)
