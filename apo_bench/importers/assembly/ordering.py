"""Find an order in which parts can be put together: the finished assembly is taken apart, and read backwards.

A part can leave if a straight way out of all its contacts is free, also for the hand above it, and if the part, put
back, would rest on the others. Where no part can leave alone, connected parts leave as one group: they are put together
next to the assembly first, on the table.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, combinations
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import Assembly, Contact, Meetings, Operation, Poses
from apo_bench.geometry import Array, Solid, measure_drop, measure_extent, pose
from apo_bench.importers.assembly.posed import TABLE
from apo_bench.importers.assembly.staging import find_stance
from apo_bench.importers.assembly.touching import find_contacts
from apo_bench.planning.insertion.arrival import arrive
from apo_bench.planning.insertion.macros import UP
from apo_bench.planning.prediction.stability import BALANCED, imbalance

_FALLS_M = 7e-4
"""A part that hangs in a hole falls by its play."""
_CARRIES = 1e-3
"""Of the normal of a contact that carries, upwards."""
_MOST_SETS = 4000
"""The search ends after this number of sets of parts."""
_LARGEST_GROUP = 4


class RemovalObstacle(NamedTuple):
    """Why a part cannot leave."""

    passed: int
    """The number of tests of `_leave` that it passed."""
    reason: str


class Placing(NamedTuple):
    """One operation of the order that was found."""

    moves: tuple[str, ...]
    """The main part first."""
    contacts: tuple[Contact, ...]
    """Of the moved parts, in this order, on the others."""
    at: Array
    """(4, 4), where the main part goes, frame of the assembly, [m]."""
    why: str
    """In words: its direction, and the parts that carry it."""


@final
@dataclass
class OrderSearch:
    """The search for an order, and the obstacles on its way."""

    solids: Mapping[str, Solid]
    """All of them, the table too."""
    poses: Poses
    contacts: tuple[Contact, ...]
    aside: Array
    """(3,): where a sub-assembly is put together, from its place in the assembly, level, [m]."""
    wanted: Sequence[str] = ()
    """Parts in the order in which they are put, where that is possible."""
    failed: set[frozenset[str]] = field(default_factory=set)
    obstacles: dict[str, RemovalObstacle] = field(default_factory=dict)
    """Part -> why it could not leave, where it passed most tests."""
    left: frozenset[str] = frozenset()
    """The fewest parts of which none could leave."""

    def find(self, fixed: frozenset[str]) -> tuple[Placing, ...] | None:
        """Return the operations that put all parts where they belong; None if there is no such order."""
        return self._order_of(frozenset(self.solids), fixed | {TABLE})

    def stuck(self) -> list[str]:
        """Return why each of the fewest parts that are left cannot leave, one sentence each."""
        return [obstacle.reason for part, obstacle in self.obstacles.items() if part in self.left]

    def _order_of(self, there: frozenset[str], base: frozenset[str]) -> tuple[Placing, ...] | None:
        """The order of the parts in `there`, of which those in `base` are there already."""
        if there == base:
            return ()
        if there in self.failed or len(self.failed) > _MOST_SETS:
            return None
        for placing in self._leaving(there, base):
            before = self._order_of(there - set(placing.moves), base)
            if before is not None:
                beside = self._put_together_beside(placing.moves) if len(placing.moves) > 1 else None
                return (*before, *(beside or ()), placing)
        self.failed.add(there)
        return None

    def _leaving(self, there: frozenset[str], base: frozenset[str]) -> Iterator[Placing]:
        """The parts that can leave, straight up from the top first; groups only where no part can."""
        free = [part for part in self.solids if part in there - base]
        single = []
        for part in free:
            found = self._leave((part,), there)
            if isinstance(found, Placing):
                single.append(found)
            elif found.passed >= self.obstacles.get(part, found).passed:
                self.obstacles[part] = found
        if single:
            yield from sorted(single, key=self._lateness)
            return
        large_first = sorted(free, key=lambda part: -self.solids[part].volume)
        for group in chain.from_iterable(combinations(large_first, size) for size in range(2, _LARGEST_GROUP + 1)):
            placing = self._leave(group, there) if self._is_connected(group) else None
            if isinstance(placing, Placing) and self._put_together_beside(group) is not None:
                yield placing
        if not self.left or len(free) < len(self.left):
            self.left = frozenset(free)

    def _lateness(self, placing: Placing) -> tuple[float, ...]:
        """The last part comes first: from above before from the side, the highest first."""
        part = placing.moves[0]
        low, _ = measure_extent(self.solids[part].pieces, self.poses[part][2, :3])
        return (
            -self.wanted.index(part) if part in self.wanted else 0,
            "from above" not in placing.why,
            -round(low + float(self.poses[part][2, 3]), 4),
            self.solids[part].volume,
        )

    def _leave(self, moves: Sequence[str], there: frozenset[str]) -> Placing | RemovalObstacle:
        """Return how parts come to their places last of all that are there, or why they cannot."""
        rest = [part for part in self.solids if part in there and part not in moves]
        main = moves[0]
        poses = self.poses
        # Contacts of moved parts with the others, the moved face first.
        pairs = (pair for a, b in self.contacts for pair in ((a, b), (b, a)))
        contacts = tuple(Contact(a, b) for a, b in pairs if a.part in moves and b.part in rest)
        others = ", ".join(dict.fromkeys(of.part for contact in contacts for of in contact if of.part in rest))
        assembly = Assembly({part: self.solids[part] for part in (*moves, *rest)}, (), frozenset())
        # A part that is put back must rest: another is below it, and its weight is over the parts that carry it. The
        # macros of its contacts give a straight way, which must be free.
        if not contacts:
            return RemovalObstacle(0, f"'{main}' touches nothing that would be there before it")
        if (
            min(measure_drop(self.solids[m], poses[m], self.solids[r], poses[r]) for m in moves for r in rest)
            > _FALLS_M
        ):
            return RemovalObstacle(1, f"nothing is below '{main}' that would carry it")
        if imbalance(Meetings(assembly), Operation(main, contacts, tuple(moves[1:])), poses) > BALANCED:
            return RemovalObstacle(
                2, f"'{main}' would not keep its balance on {others}, which would be there before it"
            )
        arrival = arrive(assembly, moves, contacts, poses)
        if all(each.normal @ UP < _CARRIES for each in arrival.touched):
            return RemovalObstacle(2, f"'{main}' would only touch upright walls of {others}, so nothing carries it")
        if not arrival.free:
            return RemovalObstacle(3, f"'{main}' cannot leave {others}")
        way = poses[main][:3, :3] @ arrival.line.direction
        along = f"along ({', '.join(f'{x:.3g}' for x in np.round(way, 3) + 0.0)})"
        direction = "from above" if way[2] < -0.9 else "from below" if way[2] > 0.9 else along
        return Placing(tuple(moves), contacts, poses[main], f"comes {direction}, onto {others}")

    def _put_together_beside(self, group: tuple[str, ...]) -> tuple[Placing, ...] | None:
        """Return how a group is put together next to the assembly, its main part on the table."""
        main = group[0]
        stance = find_stance(self.solids[main], self.poses[main][:3, :3])
        if not stance.stands or stance.rolls:
            return None
        # The same search for the group alone, on the table, each part at its place in the group.
        shift = pose.at(self.aside + np.array([0.0, 0.0, stance.height_m - float(self.poses[main][2, 3])]))
        poses = {part: shift @ self.poses[part] for part in group} | {TABLE: self.poses[TABLE]}
        solids = {part: self.solids[part] for part in (*group, TABLE)}
        inner = OrderSearch(solids, poses, find_contacts(solids, poses), self.aside)
        base = frozenset((main, TABLE))
        first = inner._leave((main,), base)
        rest = inner._order_of(frozenset(solids), base)
        return None if rest is None or not isinstance(first, Placing) else (first, *rest)

    def _is_connected(self, group: Sequence[str]) -> bool:
        """Whether each part of a group is reached from the first by contacts within the group."""
        known = {group[0]}
        for _ in group:
            for a, b in self.contacts:
                if {a.part, b.part} <= set(group) and known & {a.part, b.part}:
                    known |= {a.part, b.part}
        return known == set(group)
