"""In which order parts can be put together: the finished assembly is taken apart in thought, and read backwards.

A part can go if a straight way out of all its contacts is free, also for the hand above it, and if the part, put back,
would rest on what is left. Where no part can go alone, parts that hold together go as one: they are put together
beside the assembly first, on the table.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, combinations
from typing import NamedTuple, final

import numpy as np

from apo_bench.assembly import Assembly, Contact, Operation, Poses
from apo_bench.geometry import Array, Solid, drop, extent, intrusion_depths, pose
from apo_bench.importers.assembly.posed import TABLE
from apo_bench.importers.assembly.touching import found_contacts
from apo_bench.importers.assembly.waiting import Stance, stance
from apo_bench.planning.insertion.arrival import CLEAR_M, Arrival, arrive
from apo_bench.planning.insertion.macros import UP
from apo_bench.planning.prediction.stability import BALANCED, imbalance

_FALLS_M = 7e-4
"""What hangs in a hole falls by its play."""
_CARRIES = 1e-3
"""Of the normal of a contact that carries, upwards."""
_MOST_LOOKS = 4000
"""Sets of parts that are looked at before the search ends."""
_LARGEST_GROUP = 4
_TESTS = 4
_STEP_M = 5e-4
"""Places on a way are so far apart where it is asked what is on it."""


class Why(NamedTuple):
    """Why a part cannot go."""

    passed: int
    """How many of the tests of `_leaves` it passed."""
    words: str
    blocked: Arrival | None = None
    """The way that is not free, if that is why."""
    rest: tuple[str, ...] = ()
    """What may be in it."""


class Placing(NamedTuple):
    """One operation of the order that was found."""

    moves: tuple[str, ...]
    """The main part first."""
    contacts: tuple[Contact, ...]
    """Of what moves, in this order, on what rests."""
    at: Array
    """(4, 4), where the main part goes, frame of the assembly, [m]."""
    why: str
    """In words: how it comes, what carries it."""


@final
@dataclass
class OrderSearch:
    """The search for an order, and what it learned on its way."""

    solids: Mapping[str, Solid]
    """All of them, the table too."""
    poses: Poses
    contacts: tuple[Contact, ...]
    aside: Array
    """(3,): where a sub-assembly is put together, from its place in the assembly, level, [m]."""
    asked: Sequence[str] = ()
    """Parts in the order in which they are to be put, where that can be."""
    failed: set[frozenset[str]] = field(default_factory=set)
    reasons: dict[str, Why] = field(default_factory=dict)
    """Part -> why it could not go, where it passed most tests; of these, where fewest others were there."""
    left: frozenset[str] = frozenset()
    """The fewest parts of which none could go."""
    looks: int = 0

    def order(self, fixed: frozenset[str]) -> tuple[Placing, ...] | None:
        """The operations that put all parts where they belong; None if there is no such order."""
        return self._without(frozenset(self.solids), fixed | {TABLE})

    def _without(self, there: frozenset[str], base: frozenset[str]) -> tuple[Placing, ...] | None:
        """The order in which `there` comes about, `base` being there already."""
        if there == base:
            return ()
        if there in self.failed or self.looks > _MOST_LOOKS:
            return None
        self.looks += 1
        for placing in self._leaving(there, base):
            before = self._without(there - set(placing.moves), base)
            if before is not None:
                beside = self._beside(placing.moves) if len(placing.moves) > 1 else None
                return (*before, *(beside or ()), placing)
        self.failed.add(there)
        return None

    def _leaving(self, there: frozenset[str], base: frozenset[str]) -> Iterator[Placing]:
        """What can be taken off, what comes straight up from the top first; groups only where no part can."""
        free = [part for part in self.solids if part in there - base]
        tried = {part: self._leaves((part,), there) for part in free}
        single = [placing for placing in tried.values() if isinstance(placing, Placing)]
        for part, why in tried.items():
            if isinstance(why, Why) and why.passed >= self.reasons.get(part, why).passed:
                self.reasons[part] = why
        yield from sorted(single, key=self._late)
        if single:
            return
        large_first = sorted(free, key=lambda part: -self.solids[part].volume)
        for group in chain.from_iterable(combinations(large_first, size) for size in range(2, _LARGEST_GROUP + 1)):
            placing = self._leaves(group, there) if self._hangs_together(group) else None
            if not isinstance(placing, Placing):
                continue
            if self._beside(group) is not None:
                yield placing
            elif not _is_steady(stance(self.solids[group[0]], self.poses[group[0]][:3, :3])):
                words = f"'{group[0]}' does not stand alone, so nothing can be put into it beside the assembly"
                self.reasons[group[0]] = Why(_TESTS, words)
        if not self.left or len(free) < len(self.left):
            self.left = frozenset(free)

    def stuck(self) -> list[str]:
        """Why each of the fewest parts that are left cannot go, one sentence each."""
        left = [part for part in self.solids if part in self.left and part in self.reasons]
        return [self.reasons[part].words + self._blocker(part, self.reasons[part]) for part in left]

    def _blocker(self, part: str, why: Why) -> str:
        """What is in the way of a part along the best of the straight lines out of its contacts."""
        if why.blocked is None or why.blocked.chain.locked:
            return ""
        T = self.poses[part]
        pieces = self.solids[part].pieces
        out = np.round(-(T[:3, :3] @ why.blocked.line.direction), 3) + 0.0
        at = T[:3, 3] + np.outer(np.arange(_STEP_M, why.blocked.line.travel_m + CLEAR_M, _STEP_M), out)
        deep = [
            intrusion_depths(pieces, T[:3, :3], at, self.solids[other].pieces, self.poses[other], 0.0).max()
            for other in why.rest
        ]
        return f" along ({', '.join(f'{x:.3g}' for x in out)}): '{why.rest[int(np.argmax(deep))]}' is in its way"

    def _late(self, placing: Placing) -> tuple[float, ...]:
        """What is put in last: from above before from the side, the highest first."""
        part = placing.moves[0]
        low, _ = extent(self.solids[part].pieces, self.poses[part][2, :3])
        return (
            -self.asked.index(part) if part in self.asked else 0,
            "from above" not in placing.why,
            -round(low + float(self.poses[part][2, 3]), 4),
            self.solids[part].volume,
        )

    def _leaves(self, moves: Sequence[str], there: frozenset[str]) -> Placing | Why:
        """How parts come to their places last of all that are there, or why they cannot."""
        rest = [part for part in self.solids if part in there and part not in moves]
        main = moves[0]
        # Contacts of what moves with what rests, the face of what moves first.
        pairs = (pair for a, b in self.contacts for pair in ((a, b), (b, a)))
        closes = tuple(Contact(a, b) for a, b in pairs if a.part in moves and b.part in rest)
        others = ", ".join(dict.fromkeys(of.part for contact in closes for of in contact if of.part in rest))
        poses = self.poses
        assembly = Assembly({part: self.solids[part] for part in (*moves, *rest)}, (), frozenset())
        # A part that is put back must rest: something is below it, and its weight is over what carries it. It must come
        # along a straight way, which the macros of its contacts give, with nothing in the way.
        if not closes:
            return Why(0, f"'{main}' touches nothing that would be there before it")
        if min(drop(self.solids[m], poses[m], self.solids[r], poses[r]) for m in moves for r in rest) > _FALLS_M:
            return Why(1, f"nothing is below '{main}' that would carry it")
        if imbalance(assembly, Operation(main, closes, tuple(moves[1:])), poses) > BALANCED:
            return Why(2, f"'{main}' would not keep its balance on {others}, which would be there before it")
        arrival = arrive(assembly, moves, closes, poses)
        if all(each.normal @ UP < _CARRIES for each in arrival.touched):
            return Why(2, f"'{main}' would only touch upright walls of {others}, so nothing carries it without glue")
        if not arrival.free:
            return Why(_TESTS - 1, f"'{main}' cannot leave {others}", arrival, tuple(rest))
        way = poses[main][:3, :3] @ arrival.line.direction
        along = f"along ({', '.join(f'{x:.3g}' for x in np.round(way, 3) + 0.0)})"
        words = "from above" if way[2] < -0.9 else "from below" if way[2] > 0.9 else along
        return Placing(tuple(moves), closes, poses[main], f"comes {words}, onto {others}")

    def _beside(self, group: tuple[str, ...]) -> tuple[Placing, ...] | None:
        """How a group is put together beside the assembly, its main part on the table."""
        main = group[0]
        stands = stance(self.solids[main], self.poses[main][:3, :3])
        if not _is_steady(stands):
            return None
        # The same search for the group alone, on the table, each part at its place in the group.
        shift = pose.at(self.aside + np.array([0.0, 0.0, stands.height_m - float(self.poses[main][2, 3])]))
        poses = {part: shift @ self.poses[part] for part in group} | {TABLE: self.poses[TABLE]}
        solids = {part: self.solids[part] for part in (*group, TABLE)}
        inner = OrderSearch(solids, poses, found_contacts(solids, poses), self.aside)
        first = inner._leaves((main,), frozenset((main, TABLE)))
        if not isinstance(first, Placing):
            return None
        rest = inner._without(frozenset(solids), frozenset((main, TABLE)))
        return None if rest is None else (first, *rest)

    def _hangs_together(self, group: Sequence[str]) -> bool:
        """Whether each part of a group is reached from the first by contacts within the group."""
        known = {group[0]}
        for _ in group:
            for a, b in self.contacts:
                if {a.part, b.part} <= set(group) and known & {a.part, b.part}:
                    known |= {a.part, b.part}
        return known == set(group)


def _is_steady(stands: Stance) -> bool:
    return stands.stands and not stands.rolls
