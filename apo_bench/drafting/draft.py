"""Posed parts become a draft of a scenario: contacts, an order, starts, grasps, and what is to be said of them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from apo_bench.assembly import Poses
from apo_bench.drafting.ordering import OrderSearch, Placing
from apo_bench.drafting.posed import TABLE, PosedPart
from apo_bench.drafting.touching import clashes, closed, found_contacts, walls_without_play
from apo_bench.drafting.waiting import Stance, laid_out, reach_of, site_of, stance
from apo_bench.errors import InputError, unknown
from apo_bench.geometry import Array, Box, PadPlace, Solid, extent, holds, intrusion_depths, pose
from apo_bench.parts import load_part
from apo_bench.scenario.scenario import Site

_OPENING_M = 0.046
"""How far each finger of the arm that comes with the benchmark opens."""
_LOW_M = 1e-4
_GROUP_ROOM_M = 0.05
_FARTHEST_ASIDE_M = 0.26
_FINGER_M = (0.013, 0.018, 0.035)
_MOST_HOLDS = 300
"""Half the size of a finger with room to open and to go down, from 10 mm below its tip up; so many places are looked
at."""
_ROOM_M = 0.002
"""Room that the robot asks for; a finger that goes down flush with a wall strikes it."""
_OVER_M = 0.005
"""How far tips may be over the top of a part that stands out little; pads hold its uppermost 5 mm then."""


@final
@dataclass(frozen=True, eq=False)
class Draft:
    """A scenario, before it is written."""

    parts: tuple[PosedPart, ...]
    """At the poses at which all contacts are closed."""
    fixed: tuple[str, ...]
    why_fixed: str
    order: tuple[Placing, ...]
    starts: Mapping[str, Array]
    """(4, 4), world, [m]; of fixed parts in the frame of the assembly."""
    stances: Mapping[str, Stance]
    grasps: Mapping[str, PadPlace | None]
    site: Site
    clearance_mm: float
    notes: tuple[str, ...]
    """What a person should know, one sentence each."""
    unfit: tuple[str, ...]
    """Those of them that say why the robot cannot do a part: it does not stand, or there is no place to hold it."""
    up: str = "z"
    """Which axis of the poses that were given looks up, and why, in words."""


class NoOrder(RuntimeError):
    """Parts cannot be put together one after the other, with this side up."""


def draft(parts: Sequence[PosedPart], fixed: Sequence[str] = (), clearance_mm: float = 0.25) -> Draft:
    """Make a scenario of parts that stand on the table as `on_the_table` puts them.

    Args:
        fixed: Parts that stay where they are; none: the largest of those that lie lowest.
        clearance_mm: Room per side of faces that their part files mark as fit.

    Raises:
        InputError: No part has that name, or there is no room on the table.
        RuntimeError: Parts are inside each other.
        NoOrder: There is no order in which they can be put together.
    """
    solids = {each.name: each.solid for each in parts} | {TABLE: load_part(TABLE)}
    poses: Poses = {each.name: each.T for each in parts} | {TABLE: np.eye(4)}
    for name in fixed:
        if name not in solids or name == TABLE:
            raise InputError(unknown("part", name, [each.name for each in parts]))
    base, why_fixed = (
        (tuple(fixed), "as asked") if fixed else (lowest(parts)[:1], "the largest of those that lie lowest")
    )
    wrong = clashes(solids, poses, clearance_mm, {each.name: each.file for each in parts})
    if wrong:
        raise RuntimeError("; ".join(wrong) + ".")
    poses, contacts, dropped = closed(solids, poses, found_contacts(solids, poses), (TABLE, *base))
    notes = [
        *(f"'{contact}' touches, but not exactly where the other contacts put it: left out" for contact in dropped),
        *(
            f"'{contact}' and '{opposite}' leave no play between them; give their part room, or say fit = true of its "
            "faces"
            for contact, opposite in walls_without_play(solids, poses, contacts)
        ),
    ]
    reach = reach_of(solids, poses, [each.name for each in parts])
    aside = np.array([-min(2.0 * reach + _GROUP_ROOM_M, _FARTHEST_ASIDE_M), 0.0, 0.0])
    search = OrderSearch(solids, poses, contacts, aside)
    order = search.order(frozenset(base))
    if order is None:
        raise NoOrder("; ".join(["there is no order in which these parts can be put together", *search.stuck()]) + ".")
    # Where assemblies may stand is kept free: the assembly, and a sub-assembly that is put together beside it.
    is_beside = any(np.linalg.norm(placing.at - poses[placing.moves[0]]) > _LOW_M for placing in order)
    site = site_of(reach, is_beside)
    middles = [site.center_m, site.center_m + aside[:2]] if is_beside else [site.center_m]
    keep_free = [(np.array(middle), reach + max(site.spread_m)) for middle in middles]
    turns = {each.name: poses[each.name][:3, :3] for each in parts if each.name not in base}
    stances = {part: stance(solids[part], R) for part, R in turns.items()}
    starts = {part: np.array(poses[part]) for part in (*base, *turns)}
    for part, at in laid_out(solids, turns, keep_free).items():
        starts[part][:3, 3] = (*at, stances[part].height_m)
    grasps, crowded = _holds(solids, poses, order, base)
    unfit = (*crowded, *_unfit(solids, turns, stances, grasps))
    rolling = [f"'{part}' lies on a round wall at its start and may roll" for part, it in stances.items() if it.rolls]
    return Draft(
        tuple(replace(each, T=poses[each.name]) for each in parts),
        base,
        why_fixed,
        order,
        starts,
        stances,
        grasps,
        site,
        clearance_mm,
        (*notes, *unfit, *rolling),
        unfit,
    )


def lowest(parts: Sequence[PosedPart]) -> tuple[str, ...]:
    """The parts that lie on the table, the largest first."""
    low = {each.name: extent(each.solid.pieces, each.T[2, :3])[0] + float(each.T[2, 3]) for each in parts}
    lie = [each for each in parts if low[each.name] < min(low.values()) + _LOW_M]
    return tuple(each.name for each in sorted(lie, key=lambda each: -each.solid.volume))


def _holds(
    solids: Mapping[str, Solid], poses: Poses, order: Sequence[Placing], base: Sequence[str]
) -> tuple[Mapping[str, PadPlace | None], list[str]]:
    """Where each part is held: the best place at which fingers have room beside what stands when it is put down.

    And what is to be said of parts that have no such place.
    """
    best: dict[str, PadPlace | None] = {}
    notes = list[str]()
    there = {*base}
    for placing in order:
        main = placing.moves[0]
        others = [part for part in there if part not in placing.moves]
        up = np.round(poses[main][2, :3], 9)
        offered = holds(solids[main], up, _OPENING_M)
        # First places within the part; then those with tips over its top, whose fingers need room below, too.
        free = (
            hold
            for over, below in ((0.0, 0.0), (_OVER_M, _ROOM_M))
            for hold in holds(solids[main], up, _OPENING_M, over)[:_MOST_HOLDS]
            if not _struck(hold, below, poses[main], solids, poses, others)
        )
        best[main] = next(free, None)
        if offered and best[main] is None:
            best[main] = offered[0]
            notes.append(
                f"wherever a gripper holds '{main}', fingers that reach 10 mm below their tips meet what stands around "
                "its place; let it stand out higher, or give it a handle"
            )
        there |= set(placing.moves)
    return best, notes


def _struck(
    hold: PadPlace, below_m: float, T: Array, solids: Mapping[str, Solid], poses: Poses, others: Sequence[str]
) -> bool:
    """Whether a finger beside a part at T would be in one of the others, or so far below it."""
    # Two boxes beside the part, in a frame with x across the pads and z up, from below their tips to above the part.
    up = T[2, :3]
    out = hold.half_width + _FINGER_M[0] - _ROOM_M
    high = 0.025 - below_m / 2
    half = np.add(_FINGER_M, (0.0, 0.0, below_m / 2))
    fingers = tuple(Box("", np.array([sign * out, 0.0, high]), half) for sign in (-1.0, 1.0))
    R = T[:3, :3] @ np.column_stack([hold.across, np.cross(up, hold.across), up])
    at = pose.apply(T, hold.point[None])
    return any(intrusion_depths(fingers, R, at, solids[part].pieces, poses[part])[0] > 0.0 for part in others)


def _unfit(
    solids: Mapping[str, Solid],
    turns: Mapping[str, Array],
    stances: Mapping[str, Stance],
    grasps: Mapping[str, PadPlace | None],
) -> Iterator[str]:
    """What is to be said of parts that do not stand, or cannot be held."""
    for part, R in turns.items():
        if not stances[part].stands:
            yield f"'{part}' needs turning over: it does not stand on the table as it is in the assembly"
        if grasps[part] is None:
            size = " x ".join(f"{1e3 * np.ptp(extent(solids[part].pieces, R[i])):.4g}" for i in range(3))
            yield (
                f"'{part}', {size} mm as it stands, offers no place to a gripper from above that opens to "
                f"{2e3 * _OPENING_M:g} mm"
            )
