"""Find the rest interval that ends each operation of a scenario.

Operations end one after another. A part that comes to rest is explained by the operation in progress if that one moves
it. The best choice of intervals explains most, and has long intervals and nearly closed contacts.
"""

from collections.abc import Callable, Iterator, Sequence
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
_UNEXPLAINED = 5.0
"""Penalty for each interval that no operation explains."""
_SKIPPED = 8.0
"""Penalty for an operation that nobody saw, as its part was hidden."""
_LOST_S = 0.5  # a part that is seen at rest no more this long before the end of the log was lost, or not put down
_OVERLAP_S = 0.5
"""An operation may take its part this much earlier than the part of the previous operation comes to rest."""


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


class _Choice(NamedTuple):
    """A choice of intervals for the first operations, with its worth."""

    worth: float
    unexplained: int
    intervals: Chosen

    @property
    def value(self) -> float:
        return self.worth - _UNEXPLAINED * self.unexplained


def find_order(
    assembly: Assembly, intervals: RestIntervals, start: Poses, T_world_camera: Array, unseen: Sequence[int]
) -> Chosen:
    """Return the best choice of intervals.

    Dynamic programming over operations: what follows depends on a choice nearly only by its last interval, so the best
    of the choices that end with the same interval is kept.

    Args:
        intervals: Rest intervals of every tracked part, in the frame of the camera.
        start: Poses of parts that are not tracked, world, [m].
        unseen: Operations that were not observed, counted from 0.

    Raises:
        NoMatchingOrder: No choice has the order of the operations.
    """

    @cache
    def worth(k: int, interval: RestInterval) -> float:
        """Return the worth of an interval as the end of operation k."""
        seen = find_rest_poses(intervals, interval.ends, settled=list_settled(assembly, k))
        poses = {**start, **{part: T_world_camera @ T for part, T in seen.items()}}
        images = list_images(assembly.solids[interval.part], poses[interval.part])
        wrong_mm = min(contact_fit(assembly, k, {**poses, interval.part: T}).wrong_mm for T in images)
        return min(interval.seconds, _LONG_S) - min(wrong_mm, _WIDE_MM) / 10.0

    choices = [_Choice(0.0, 0, ())]
    while len(choices[0].intervals) < len(assembly):
        longer = [each for choice in choices for each in _lengthen(choice, assembly, intervals, worth, unseen)]
        if not longer:
            break
        choices = [*{each.intervals[-1]: each for each in sorted(longer, key=lambda each: each.value)}.values()]
    reached = len(choices[0].intervals)
    after_end = [_count_unexplained(each.intervals, np.inf, assembly, intervals) for each in choices]
    choices = [each._replace(unexplained=each.unexplained + n) for each, n in zip(choices, after_end, strict=True)]
    if reached < len(assembly):  # the log may end before the last operations, if it shows no others
        choices = [each for each in choices if any(each.intervals) and not each.unexplained]
    if not choices:
        raise _explain_order(assembly, intervals, reached)
    best = max(choices, key=lambda each: each.value)
    return (*best.intervals, *[None] * (len(assembly) - reached))


def stated_order(assembly: Assembly, intervals: RestIntervals, ends: Sequence[float]) -> Chosen:
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
    return tuple(chosen)


def describe_moves(intervals: RestIntervals) -> str:
    """Return the times at which parts came to rest as text, for an error message."""
    arrivals = sorted((each.begins, part) for part, known in intervals.items() for each in known[1:])
    return ", ".join(f"{part} {t:.1f} s" for t, part in arrivals[:12]) or "none"


def time_taken(intervals: RestIntervals, before: Chosen, interval: RestInterval) -> float:
    """Return the time until which a part rested where earlier operations had left it, [s].

    Args:
        before: The intervals that end the operations before this one.
        interval: The interval that ends this operation.
    """
    known = intervals[interval.part]
    own = known[: known.index(interval)]
    there = [each for each in own if each.came <= _ended(before) + _OVERLAP_S]
    return (there or own)[-1 if there else 0].gone if own else 0.0


def end_of_operation(intervals: RestIntervals, chosen: Chosen, k: int) -> float:
    """Return the time when observed operation k had ended, [s]: when the next one began, else the end of its rest."""
    interval = chosen[k]
    assert interval is not None
    later = (time_taken(intervals, chosen[:j], each) for j, each in enumerate(chosen) if j > k and each is not None)
    return float(np.clip(next(later, interval.ends), interval.came, interval.ends))


def list_settled(assembly: Assembly, k: int) -> set[str]:
    """Return the parts that no operation after operation k moves."""
    return {*assembly.solids} - {part for operation in assembly.operations[k + 1 :] for part in operation.moves}


def _lengthen(
    choice: _Choice,
    assembly: Assembly,
    intervals: RestIntervals,
    worth: Callable[[int, RestInterval], float],
    unseen: Sequence[int],
) -> Iterator[_Choice]:
    """Yield the choice with each interval that may end the next operation, or None if that may have been hidden."""
    k = len(choice.intervals)
    known = intervals[assembly.operations[k].main]
    # The first interval is the start, unless the part was hidden before.
    first = 1 + max(
        (known.index(each) for each in choice.intervals if each in known), default=-known[0].rests[0].hidden
    )
    for interval in known[first:] if k not in unseen else ():
        ended = _ended(choice.intervals)
        # A part that was hidden may have been put down and taken again meanwhile.
        taken = ended if interval.rests[0].hidden else time_taken(intervals, choice.intervals, interval)
        if interval.begins > ended and taken + _OVERLAP_S >= ended:
            chosen = (*choice.intervals, interval)
            unexplained = _count_unexplained(choice.intervals, _ended(chosen), assembly, intervals)
            yield _Choice(choice.worth + worth(k, interval), choice.unexplained + unexplained, chosen)
    is_lost = known[-1].ends < max(each[-1].ends for each in intervals.values()) - _LOST_S
    if k in unseen or is_lost or any(each.rests[0].hidden for each in known):
        yield _Choice(choice.worth - _SKIPPED * (k not in unseen), choice.unexplained, (*choice.intervals, None))


def _count_unexplained(chosen: Chosen, until: float, assembly: Assembly, intervals: RestIntervals) -> int:
    """Return how many parts came to rest between the last observed operation and a time, [s], without a reason.

    Operations that were not observed since, and the one that ends at this time, explain the parts that they move.
    """
    since = max((k + 1 for k, each in enumerate(chosen) if each is not None), default=0)
    ends_now = len(chosen) + (until < np.inf)
    moved = {part for operation in assembly.operations[since:ends_now] for part in operation.moves}
    return sum(
        _ended(chosen) + _OVERLAP_S < each.came and each.begins < until + _OVERLAP_S
        for part, known in intervals.items()
        if part not in moved
        for each in known[1:]
    )


def _ended(chosen: Chosen) -> float:
    """Return the earliest time at which the last observed operation may have ended, [s]."""
    return max((each.came for each in chosen if each is not None), default=-np.inf)


def _explain_order(assembly: Assembly, intervals: RestIntervals, k: int) -> NoMatchingOrder:
    """Return an error that names the operation for which no interval is left."""
    if all(len(known) == 1 for known in intervals.values()):
        return NoMatchingOrder(
            "no part comes to rest at another place than before, so the log shows no operation; give a log that goes "
            "on until the part of the first operation has rested for 0.3 s."
        )
    part = assembly.operations[k].main
    rests = ", ".join(f"{interval.begins:.2f} s" for interval in intervals[part])
    return NoMatchingOrder(
        f"the moves of the log ({describe_moves(intervals)}) have another order than the operations of the "
        f"scenario: '{part}', which operation {k + 1} moves, rests from {rests} on; none of these "
        "follows the others; check the ids in the objects file and that the log begins before the first part "
        "is taken, or state --operation-ends, or --unobserved for operations that the log does not show."
    )
