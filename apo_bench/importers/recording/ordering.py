"""Which stay of which part ends which operation of a scenario.

The last operation that moves a part ends with its last stay. Before, a hand may pause with a part in the air: among all
choices in the order of the operations, the one is taken whose stays are long and whose contacts are nearly closed.
"""

from collections.abc import Callable, Collection, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from apo_bench.assembly import Assembly, Contact, Poses, height, measure_round
from apo_bench.errors import InputError, require
from apo_bench.geometry import Array, RoundFace, beside, face_area
from apo_bench.importers.recording.stays import Stay, Stays, flip_time, poses_at

_LONG_S = 1.0
_WIDE_MM = 50.0
"""A stay counts its seconds, up to 1; an open contact counts against it, 1 for each 10 mm or degrees, up to 5."""
_LEFT_OVER = 5.0
"""What a stay counts against a choice in which no operation leads to it."""
_OVERLAP_S = 0.3
"""A part may be taken so long before the one before it is seen to rest."""
_CLOSE = 0.3
"""Two choices whose worth differs by less are not told apart."""


class Stated(NamedTuple):
    """What a person states because the log does not say it."""

    ends: tuple[float, ...] = ()
    """Times at which the operations ended, [s]."""
    unseen: tuple[int, ...] = ()
    """Operations that the log does not show, counted from 0."""


Chosen = tuple[Stay | None, ...]
"""The stay with which each of the first operations ends; None of one that was not seen."""


class NoOrder(InputError):
    """The moves of a log are not those of the scenario."""


class ContactFit(NamedTuple):
    """The worst of some contacts."""

    gap_m: float
    """From the middle of the smaller face to the plane of the other one and from beside it to it, or between axes."""
    angle_rad: float
    """Between the normal of one and the opposite of the other, or between axes."""

    @property
    def wrong_mm(self) -> float:
        """A degree counts like a millimetre."""
        return 1e3 * self.gap_m + float(np.degrees(self.angle_rad))


def contact_fit(assembly: Assembly, k: int, poses: Poses) -> ContactFit:
    """How far the contacts that operation k makes are open, if it ended with these poses, world, [m]."""
    fits = [ContactFit(0.0, 0.0), *(_fit(assembly, contact, poses) for contact in assembly.operations[k].contacts)]
    return ContactFit(max(fit.gap_m for fit in fits), max(fit.angle_rad for fit in fits))


def _fit(assembly: Assembly, contact: Contact, poses: Poses) -> ContactFit:
    (a, T_a), (b, T_b) = ((assembly.face_of(of), poses[of.part]) for of in contact)
    if isinstance(a, RoundFace) or isinstance(b, RoundFace):
        measured = measure_round(a, T_a, b, T_b)
        return ContactFit(abs(measured.gap_m), measured.angle_rad)
    # The middle of the smaller face is held against the larger one: how high above its plane, how far beside it.
    if face_area(a) > face_area(b):
        (a, T_a), (b, T_b) = (b, T_b), (a, T_a)
    cosine = float((T_a[:3, :3] @ a.normal) @ (T_b[:3, :3] @ b.normal))
    apart = float(np.hypot(height(a, T_a, b, T_b), beside(a, T_a, b, T_b)))
    return ContactFit(apart, float(np.arccos(np.clip(-cosine, -1.0, 1.0))))


class Order(NamedTuple):
    """What ends which operation."""

    stays: Chosen
    rival: Chosen | None
    """Another choice that is nearly as good."""


def order_of(assembly: Assembly, stays: Stays, start: Poses, T_world_camera: Array, unseen: Sequence[int]) -> Order:
    """The best choice.

    Args:
        stays: Of every tracked part, in the frame of the camera.
        start: Where parts stand that are not tracked, world, [m].
        unseen: Operations, counted from 0, that the log does not show.

    Raises:
        NoOrder: No choice has the order of the operations.
    """
    last = {operation.main: k for k, operation in enumerate(assembly.operations) if k not in unseen}

    @cache
    def worth(k: int, stay: Stay) -> float:
        known = stays[stay.part]
        wrong_mm = contact_fit(assembly, k, world_poses(stays, stay.ends, start, T_world_camera)).wrong_mm
        carried_on = any(stay.part in other.carries for other in assembly.operations[k + 1 :])
        left = 0 if carried_on or last[stay.part] != k else len(known) - 1 - known.index(stay)
        return min(stay.seconds, _LONG_S) - min(wrong_mm, _WIDE_MM) / 10.0 - _LEFT_OVER * left

    best, why = _choices(assembly, stays, worth, unseen)
    if not best:
        raise NoOrder(
            f"the moves of the log ({moves_text(stays)}) do not follow each other as the operations of the scenario do "
            f"({', '.join(operation.main for operation in assembly.operations)}): {why}; "
            "check the ids in the objects file and that the log begins before the first part is taken, or state "
            "--ends, or --unseen for operations that the log does not show."
        )
    close = len(best) > 1 and best[0][0] - best[1][0] < _CLOSE
    return Order(best[0][1], best[1][1] if close else None)


def stated_order(assembly: Assembly, stays: Stays, ends: Sequence[float]) -> Order:
    """The stays at times that a person stated, one for each operation.

    Raises:
        InputError: Not one for each operation, or a part does not rest there.
    """
    require(
        len(ends) == len(assembly),
        f"--ends: {len(assembly)} times are needed, one for each operation, {len(ends)} were given.",
    )
    chosen = list[Stay]()
    for k, (operation, t) in enumerate(zip(assembly.operations, ends, strict=True)):
        there = next((stay for stay in stays[operation.main] if stay.begins <= t <= stay.ends), None)
        if there is None:
            raise InputError(
                f"--ends: '{operation.main}' does not rest at {t:g} s, where operation {k + 1} is to have ended; "
                "it rests "
                + (", ".join(f"{stay.begins:.2f} to {stay.ends:.2f}" for stay in stays[operation.main][:12]) or "never")
                + "."
            )
        chosen.append(there)
    return Order(tuple(chosen), None)


def world_poses(stays: Stays, t: float, start: Poses, T_world_camera: Array) -> Poses:
    """Where every part is at a time, in the world."""
    return {**start, **{part: T_world_camera @ T for part, T in poses_at(stays, t).items()}}


def moves_text(stays: Stays) -> str:
    """What moved when, in a sentence."""
    arrivals = sorted((stay.begins, part) for part, known in stays.items() for stay in known[1:])
    first_few = [f"{part} {t:.1f} s" for t, part in arrivals[:12]]
    return ", ".join(first_few) + (", ..." if len(arrivals) > 12 else "") if first_few else "nothing moves"


def _choices(
    assembly: Assembly, stays: Stays, worth: Callable[[int, Stay], float], unseen: Sequence[int]
) -> tuple[list[tuple[float, Chosen]], str]:
    """The two best choices of stays whose arrivals have the order of the operations, with their worth, the best first.

    Without any, why the first operation that has none has none.

    Dynamic programming over operations: what follows depends on a choice so far by its last stay only, but for what was
    carried; so of the choices that end with the same stay the two best are followed.
    """
    followed: list[tuple[float, float, Chosen]] = [(0.0, -np.inf, ())]
    for k, operation in enumerate(assembly.operations):
        if k in unseen:
            followed = [(value, t, (*choice, None)) for value, t, choice in followed]
            continue
        by_end: dict[Stay, list[tuple[float, float, Chosen]]] = {}
        for value, t, choice in followed:
            for stay in stays[operation.main][1:]:
                moved_on = _between(assembly, stays, choice, stay) if stay.begins > t else None
                if moved_on is not None:
                    amiss = moved_on + _strangers(stays, operation.moves, t, stay)
                    longer = (value + worth(k, stay) - _LEFT_OVER * amiss, stay.begins, (*choice, stay))
                    by_end.setdefault(stay, []).append(longer)
        if not by_end:
            return [], _why_none(assembly, stays, k)
        followed = [each for ending in by_end.values() for each in sorted(ending, key=lambda x: -x[0])[:2]]
    return sorted(((value, choice) for value, _, choice in followed), key=lambda x: -x[0])[:2], ""


def _strangers(stays: Stays, moved: Collection[str], t: float, stay: Stay) -> int:
    """How many parts that an operation does not move came to another place after the end of the one before."""
    return sum(
        any(t + _OVERLAP_S < other.begins < stay.begins + _OVERLAP_S for other in known[1:])
        for part, known in stays.items()
        if part not in moved
    )


def _why_none(assembly: Assembly, stays: Stays, k: int) -> str:
    """Why no stay can end operation k."""
    main = assembly.operations[k].main
    flipped = flip_time(assembly.solids[main], stays[main])
    if flipped is not None:
        return f"'{main}' is turned at {flipped:.2f} s to where it looks the same, probably flipped by the tracker"
    rests = ", ".join(f"{stay.begins:.2f} s" for stay in stays[main])
    return f"'{main}', which operation {k + 1} moves, rests from {rests} on, and none of these follows the others"


def taken(assembly: Assembly, stays: Stays, before: Sequence[Stay | None], stay: Stay) -> float:
    """When the part of an operation was taken: at the end of where an earlier operation had left it, else of its start.

    Args:
        before: The stays of the operations before it.
        stay: Where it was put.
    """
    part = stay.part
    own = [(k, earlier) for k, earlier in enumerate(before) if earlier is not None and earlier.part == part]
    since = own[-1][0] + 1 if own else 0
    carried = any(part in operation.carries for operation in assembly.operations[since : len(before)])
    if own and not carried:
        return own[-1][1].gone
    earlier = [other for other in stays[part] if other.begins < stay.begins]
    return earlier[-1 if carried else 0].gone if earlier else 0.0


def quiet(assembly: Assembly, stays: Stays, chosen: Sequence[Stay | None], k: int) -> float:
    """When operation k, which was seen, was over: when the next one took its part, else the end of its stay, [s]."""
    stay = chosen[k]
    assert stay is not None
    for j, later in enumerate(chosen):
        if j > k and later is not None:
            return float(np.clip(taken(assembly, stays, chosen[:j], later), stay.begins, stay.ends))
    return stay.ends


def _between(assembly: Assembly, stays: Stays, before: Chosen, stay: Stay) -> int | None:
    """How often the part of the last chosen operation still moved before the next part was taken, which goes to a stay.

    None if that was taken before the other was there: what is carried arrives with what carries it.
    """
    last = before[-1] if before else None
    if last is None:
        return 0
    t = taken(assembly, stays, before, stay)
    if last.begins > t + _OVERLAP_S:
        return None
    return sum(last.begins < other.begins < t - _OVERLAP_S for other in stays[last.part])
