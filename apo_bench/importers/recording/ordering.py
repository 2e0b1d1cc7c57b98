"""Find the rest interval that ends each operation of a scenario.

The last operation of a part should end with its last interval; earlier intervals may be pauses of a hand in the air. Of
all choices in the order of the operations, the best has long intervals and nearly closed contacts.
"""

from collections.abc import Callable, Collection, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Poses
from apo_bench.errors import InputError, require
from apo_bench.geometry import Array
from apo_bench.importers.recording.contact_fit import contact_fit
from apo_bench.importers.recording.folding import list_images
from apo_bench.importers.recording.rest_intervals import RestInterval, RestIntervals, find_rest_poses

_LONG_S = 1.0  # seconds beyond which a longer interval is not worth more
_WIDE_MM = 50.0  # misfit beyond which a contact is not worse
"""The worth of an interval is its seconds, up to 1, less 1 for each 10 mm of misfit, up to 5."""
_LEFT_OVER = 5.0
"""Penalty for each interval that no operation explains."""
_LOST_S = 0.5  # a part that is seen at rest no more this long before the end of the log was lost, or not put down
_SKIPPED = 8.0
"""Penalty for an operation that nobody saw, as its part was hidden."""
_OVERLAP_S = 0.5
"""An operation may take its part this much earlier than the part of the previous operation comes to rest."""
_CLOSE = 0.3
"""A second choice whose worth differs by less is a rival."""


class Stated(NamedTuple):
    """The user's statements about the order, where the log is ambiguous."""

    ends: tuple[float, ...] = ()
    """Times at which the operations ended, [s]; empty: not stated."""
    unseen: tuple[int, ...] = ()
    """Operations that were not observed, counted from 0."""


Chosen = tuple[RestInterval | None, ...]
"""The rest interval that ends each of the first operations; None for those not observed."""


class NoMatchingOrder(InputError):
    """The motions in the log do not match the operations of the scenario."""


class Order(NamedTuple):
    """The rest intervals that end the operations."""

    intervals: Chosen
    rival: Chosen | None
    """A second choice that is nearly as good, if there is one."""


class _Choice(NamedTuple):
    """A choice of intervals for the first operations, with its worth."""

    worth: float
    begins: float
    """Begin of the last interval, [s]; the earliest time, if its part was hidden before."""
    intervals: Chosen


def find_order(
    assembly: Assembly, intervals: RestIntervals, start: Poses, T_world_camera: Array, unseen: Sequence[int]
) -> Order:
    """Return the best choice of intervals, with its rival.

    Args:
        intervals: Rest intervals of every tracked part, in the frame of the camera.
        start: Poses of parts that are not tracked, world, [m].
        unseen: Operations that were not observed, counted from 0.

    Raises:
        NoMatchingOrder: No choice has the order of the operations.
    """
    # Part -> its last observed operation.
    last = {operation.main: k for k, operation in enumerate(assembly.operations) if k not in unseen}

    @cache
    def worth(k: int, interval: RestInterval) -> float:
        """Return the worth of an interval as the end of operation k."""
        known = intervals[interval.part]
        poses = {**start, **{part: T_world_camera @ T for part, T in find_rest_poses(intervals, interval.ends).items()}}
        images = list_images(assembly.solids[interval.part], poses[interval.part])
        wrong_mm = min(contact_fit(assembly, k, {**poses, interval.part: T}).wrong_mm for T in images)
        is_carried_later = any(interval.part in other.carries for other in assembly.operations[k + 1 :])
        is_last = last[interval.part] == k and not is_carried_later
        left = len(known) - 1 - known.index(interval) if is_last else 0  # later intervals that no operation explains
        return min(interval.seconds, _LONG_S) - min(wrong_mm, _WIDE_MM) / 10.0 - _LEFT_OVER * left

    best = _best_choices(assembly, intervals, worth, unseen)
    is_close = len(best) > 1 and best[0].worth - best[1].worth < _CLOSE
    return Order(best[0].intervals, best[1].intervals if is_close else None)


def stated_order(assembly: Assembly, intervals: RestIntervals, ends: Sequence[float]) -> Order:
    """Return the intervals that contain the stated times, one for each operation.

    Raises:
        InputError: There is not one time for each operation, or a part does not rest there.
    """
    require(
        len(ends) == len(assembly),
        f"--operation-ends: {len(assembly)} times are needed, one for each operation, {len(ends)} were given.",
    )
    chosen = list[RestInterval]()
    for k, (operation, t) in enumerate(zip(assembly.operations, ends, strict=True)):
        known = intervals[operation.main]
        found = [each for each in known if each.begins <= t <= each.ends]
        rests = ", ".join(f"{each.begins:.2f} to {each.ends:.2f}" for each in known[:12])
        require(
            found,
            f"--operation-ends: '{operation.main}' of operation {k + 1} does not rest at {t:g} s; it rests {rests}.",
        )
        chosen.append(found[0])
    return Order(tuple(chosen), None)


def describe_moves(intervals: RestIntervals) -> str:
    """Return the times at which parts came to rest as text, for an error message."""
    arrivals = sorted((each.begins, part) for part, known in intervals.items() for each in known[1:])
    return ", ".join(f"{part} {t:.1f} s" for t, part in arrivals[:12]) or "none"


def _best_choices(
    assembly: Assembly, intervals: RestIntervals, worth: Callable[[int, RestInterval], float], unseen: Sequence[int]
) -> list[_Choice]:
    """Return at most two choices whose intervals are in the order of the operations, the best first.

    Dynamic programming over operations: what follows depends on a choice only by its last interval, except for carried
    parts. So the two best choices that end with the same interval are kept.

    Args:
        worth: Function of an operation, counted from 0, and the interval that ends it.
        unseen: Operations that were not observed, counted from 0.
    """
    choices = [_Choice(0.0, -np.inf, ())]
    for k, operation in enumerate(assembly.operations):
        if k in unseen:
            choices = [choice._replace(intervals=(*choice.intervals, None)) for choice in choices]
            continue
        by_end: dict[RestInterval, list[_Choice]] = {}
        for choice in choices:
            for interval in intervals[operation.main][1:]:  # the first interval is the start
                moved_on = _moves_between(assembly, intervals, choice.intervals, interval)
                if interval.begins > choice.begins and moved_on is not None:
                    # Intervals that contradict the order.
                    amiss = moved_on + _strangers(intervals, operation.moves, choice.begins, interval)
                    value = choice.worth + worth(k, interval) - _LEFT_OVER * amiss
                    longer = _Choice(value, max(choice.begins, interval.came), (*choice.intervals, interval))
                    by_end.setdefault(interval, []).append(longer)
        own = intervals[operation.main]
        is_lost = own[-1].ends < max(known[-1].ends for known in intervals.values()) - _LOST_S
        if is_lost or any(each.gone > each.ends or each.came < each.begins for each in own):
            # The part may have come to rest and gone again while it was hidden.
            skipped = [_Choice(c.worth - _SKIPPED, c.begins, (*c.intervals, None)) for c in choices]
            choices = [*(each for ending in by_end.values() for each in _best_two(ending)), *_best_two(skipped)]
            continue
        if not by_end:
            rests = ", ".join(f"{interval.begins:.2f} s" for interval in intervals[operation.main])
            raise NoMatchingOrder(
                f"the moves of the log ({describe_moves(intervals)}) have another order than the operations of the "
                f"scenario: '{operation.main}', which operation {k + 1} moves, rests from {rests} on; none of these "
                "follows the others; check the ids in the objects file and that the log begins before the first part "
                "is taken, or state --operation-ends, or --unobserved for operations that the log does not show."
            )
        choices = [each for ending in by_end.values() for each in _best_two(ending)]
    return _best_two(choices)


def _best_two(choices: list[_Choice]) -> list[_Choice]:
    """Return the two choices of greatest worth, the best first."""
    return sorted(choices, key=lambda choice: -choice.worth)[:2]


def _strangers(intervals: RestIntervals, moved: Collection[str], t: float, until: RestInterval) -> int:
    """Return how many parts that an operation does not move came to rest elsewhere during it.

    Args:
        moved: Parts that the operation moves.
        t: Begin of the last interval of the operation before, [s].
        until: The interval that ends the operation.
    """
    return sum(
        any(t + _OVERLAP_S < other.came and other.begins < until.begins + _OVERLAP_S for other in known[1:])
        for part, known in intervals.items()
        if part not in moved
    )


def time_taken(
    assembly: Assembly, intervals: RestIntervals, before: Sequence[RestInterval | None], interval: RestInterval
) -> float:
    """Return the time at which the part of an operation was taken, [s].

    It is the end of the interval in which an earlier operation left the part, or of its start.

    Args:
        before: The intervals that end the operations before this one.
        interval: The interval that ends this operation.
    """
    part = interval.part
    own = [(k, each) for k, each in enumerate(before) if each is not None and each.part == part]
    since = own[-1][0] + 1 if own else 0  # the first operation after that which put the part
    # A carrier moved the part since, so the interval just before counts.
    is_carried = any(part in operation.carries for operation in assembly.operations[since : len(before)])
    if own and not is_carried:
        return own[-1][1].gone
    earlier = [other for other in intervals[part] if other.begins < interval.begins]
    return earlier[-1 if is_carried else 0].gone if earlier else 0.0


def end_of_operation(
    assembly: Assembly, intervals: RestIntervals, chosen: Sequence[RestInterval | None], k: int
) -> float:
    """Return the time at which observed operation k ended, [s]: when the next one began, else the end of its rest.

    Args:
        chosen: The interval that ends each operation.
    """
    interval = chosen[k]
    assert interval is not None
    for j, later in enumerate(chosen):
        if j > k and later is not None:
            t = time_taken(assembly, intervals, chosen[:j], later)
            return float(np.clip(t, interval.begins, interval.ends))
    return interval.ends


def _moves_between(assembly: Assembly, intervals: RestIntervals, before: Chosen, interval: RestInterval) -> int | None:
    """Return how often the part of the operation before still moved until the next part was taken.

    None if the next part was taken before the part of the operation before came to rest, which excludes this choice.

    Args:
        before: The intervals that end the operations before.
        interval: The interval that ends the next operation.
    """
    last = before[-1] if before else None
    if last is None:
        return 0
    t = time_taken(assembly, intervals, before, interval)
    if last.came > t + _OVERLAP_S:
        return None
    return sum(last.begins < other.begins < t - _OVERLAP_S for other in intervals[last.part])
