"""Find which rest interval of which part ends which operation of a scenario.

The last operation that moves a part ends with its last interval. Before, a hand may pause with a part in the air: of
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
from apo_bench.importers.recording.rest_intervals import RestInterval, RestIntervals, find_rest_poses

_LONG_S = 1.0
_WIDE_MM = 50.0
"""An interval counts its seconds, up to 1; an open contact counts against it, 1 for each 10 mm or degrees, up to 5."""
_LEFT_OVER = 5.0
"""The penalty of an interval to which no operation leads."""
_OVERLAP_S = 0.3
"""A part may be taken this time before the previous part rests."""
_CLOSE = 0.3
"""Choices whose worth differs by less are rivals."""


class Stated(NamedTuple):
    """Statements of a person about the order, where the log leaves it open."""

    ends: tuple[float, ...] = ()
    """Times at which the operations ended, [s]."""
    unseen: tuple[int, ...] = ()
    """Operations that the log does not show, counted from 0."""


Chosen = tuple[RestInterval | None, ...]
"""The interval with which each of the first operations ends; None of one that was not observed."""


class NoMatchingOrder(InputError):
    """The moves of a log are not those of the scenario."""


class Order(NamedTuple):
    """The intervals that end the operations."""

    intervals: Chosen
    rival: Chosen | None
    """Another choice that is nearly as good."""


class _Choice(NamedTuple):
    """The intervals of the first operations."""

    worth: float
    begins: float
    """Of the last interval, [s]."""
    intervals: Chosen


def find_order(
    assembly: Assembly, intervals: RestIntervals, start: Poses, T_world_camera: Array, unseen: Sequence[int]
) -> Order:
    """Return the best choice.

    Args:
        intervals: Of every tracked part, in the frame of the camera.
        start: Where parts stand that are not tracked, world, [m].
        unseen: Operations, counted from 0, that the log does not show.

    Raises:
        NoMatchingOrder: No choice has the order of the operations.
    """
    last = {operation.main: k for k, operation in enumerate(assembly.operations) if k not in unseen}

    @cache
    def worth(k: int, interval: RestInterval) -> float:
        known = intervals[interval.part]
        poses = {part: T_world_camera @ T for part, T in find_rest_poses(intervals, interval.ends).items()}
        wrong_mm = contact_fit(assembly, k, {**start, **poses}).wrong_mm
        is_carried_later = any(interval.part in other.carries for other in assembly.operations[k + 1 :])
        is_last = last[interval.part] == k and not is_carried_later
        left = len(known) - 1 - known.index(interval) if is_last else 0
        return min(interval.seconds, _LONG_S) - min(wrong_mm, _WIDE_MM) / 10.0 - _LEFT_OVER * left

    best = _best_choices(assembly, intervals, worth, unseen)
    is_close = len(best) > 1 and best[0].worth - best[1].worth < _CLOSE
    return Order(best[0].intervals, best[1].intervals if is_close else None)


def stated_order(assembly: Assembly, intervals: RestIntervals, ends: Sequence[float]) -> Order:
    """Return the intervals at stated times, one for each operation.

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
    """Return which part came to rest when, for an error."""
    arrivals = sorted((each.begins, part) for part, known in intervals.items() for each in known[1:])
    return ", ".join(f"{part} {t:.1f} s" for t, part in arrivals[:12]) or "none"


def _best_choices(
    assembly: Assembly, intervals: RestIntervals, worth: Callable[[int, RestInterval], float], unseen: Sequence[int]
) -> list[_Choice]:
    """The two best choices whose arrivals have the order of the operations, the best first.

    Dynamic programming over operations: the future depends on a choice by its last interval only, but for carried
    parts; so the two best of the choices that end with the same interval are followed.
    """
    choices = [_Choice(0.0, -np.inf, ())]
    for k, operation in enumerate(assembly.operations):
        if k in unseen:
            choices = [choice._replace(intervals=(*choice.intervals, None)) for choice in choices]
            continue
        by_end: dict[RestInterval, list[_Choice]] = {}
        for choice in choices:
            for interval in intervals[operation.main][1:]:
                moved_on = _moves_between(assembly, intervals, choice.intervals, interval)
                if interval.begins > choice.begins and moved_on is not None:
                    amiss = moved_on + _strangers(intervals, operation.moves, choice.begins, interval)
                    value = choice.worth + worth(k, interval) - _LEFT_OVER * amiss
                    longer = _Choice(value, interval.begins, (*choice.intervals, interval))
                    by_end.setdefault(interval, []).append(longer)
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
    return sorted(choices, key=lambda choice: -choice.worth)[:2]


def _strangers(intervals: RestIntervals, moved: Collection[str], t: float, until: RestInterval) -> int:
    """How many parts that an operation does not move came to another place after the end of the one before."""
    return sum(
        any(t + _OVERLAP_S < other.begins < until.begins + _OVERLAP_S for other in known[1:])
        for part, known in intervals.items()
        if part not in moved
    )


def time_taken(
    assembly: Assembly, intervals: RestIntervals, before: Sequence[RestInterval | None], interval: RestInterval
) -> float:
    """Return when the part of an operation was taken, [s]: at the end of where an earlier one left it, else its start.

    Args:
        before: The intervals of the operations before it.
        interval: Where it was put.
    """
    part = interval.part
    own = [(k, each) for k, each in enumerate(before) if each is not None and each.part == part]
    since = own[-1][0] + 1 if own else 0
    is_carried = any(part in operation.carries for operation in assembly.operations[since : len(before)])
    if own and not is_carried:
        return own[-1][1].gone
    earlier = [other for other in intervals[part] if other.begins < interval.begins]
    return earlier[-1 if is_carried else 0].gone if earlier else 0.0


def end_of_operation(
    assembly: Assembly, intervals: RestIntervals, chosen: Sequence[RestInterval | None], k: int
) -> float:
    """Return when operation k, which was observed, was over, [s]: when the next one took its part, else its end."""
    interval = chosen[k]
    assert interval is not None
    for j, later in enumerate(chosen):
        if j > k and later is not None:
            t = time_taken(assembly, intervals, chosen[:j], later)
            return float(np.clip(t, interval.begins, interval.ends))
    return interval.ends


def _moves_between(assembly: Assembly, intervals: RestIntervals, before: Chosen, interval: RestInterval) -> int | None:
    """How often the part of the last chosen operation still moved before the part of the next one was taken.

    None if the latter was taken before the former was there: a carried part arrives with its carrier.
    """
    last = before[-1] if before else None
    if last is None:
        return 0
    t = time_taken(assembly, intervals, before, interval)
    if last.begins > t + _OVERLAP_S:
        return None
    return sum(last.begins < other.begins < t - _OVERLAP_S for other in intervals[last.part])
