"""Posed parts become a draft of a scenario: contacts, an order, starts, grasps, and what is to be said of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from apo_bench.assembly.goals import Poses
from apo_bench.drafting.laying import Site, laid_out, reach_of, site_of
from apo_bench.drafting.ordering import Placing, Search
from apo_bench.drafting.posed import TABLE, PosedPart
from apo_bench.drafting.standing import Stance, stance
from apo_bench.drafting.touching import clashes, closed, found_contacts, walls_without_play
from apo_bench.errors import InputError, unknown
from apo_bench.geometry import pose
from apo_bench.geometry.arrays import Array
from apo_bench.geometry.holds import Hold, holds
from apo_bench.geometry.intrusion import intrusion_depths
from apo_bench.geometry.solid import Box, Solid, extent
from apo_bench.parts import load_part

_OPENING_M = 0.046
"""How far each finger of the arm that comes with the benchmark opens."""
_LOW_M = 1e-4
_GROUP_ROOM_M = 0.05
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
    grasps: Mapping[str, Hold | None]
    site: Site
    clearance_mm: float
    notes: tuple[str, ...]
    """What a person should know, one sentence each."""


def draft(parts: Sequence[PosedPart], fixed: Sequence[str] = (), clearance_mm: float = 0.25) -> Draft:
    """Make a scenario of parts that stand on the table as `on_the_table` puts them.

    Args:
        fixed: Parts that stay where they are; none: the largest of those that lie lowest.
        clearance_mm: Room per side of faces that their part files mark as fit.

    Raises:
        InputError: No part has that name, or there is no room on the table.
        RuntimeError: Parts are inside each other, or there is no order in which they can be put together.
    """
    solids = {each.name: each.solid for each in parts} | {TABLE: load_part(TABLE)}
    poses: Poses = {each.name: each.T for each in parts} | {TABLE: np.eye(4)}
    for name in fixed:
        if name not in solids or name == TABLE:
            raise InputError(unknown("part", name, [each.name for each in parts]))
    base, why_fixed = (tuple(fixed), "as asked") if fixed else _base(parts)
    wrong = clashes(solids, poses, clearance_mm)
    if wrong:
        raise RuntimeError(_all([clash.sentence for clash in wrong]))
    poses, contacts, dropped = closed(solids, poses, found_contacts(solids, poses), (TABLE, *base))
    notes = [f"'{contact}' touches, but not exactly where the other contacts put it: left out" for contact in dropped]
    for one, other in walls_without_play(solids, poses, contacts):
        notes.append(
            f"'{one}' and '{other}' leave no play between them; give their part room, or say fit = true of its faces"
        )
    reach = reach_of(solids, poses, [each.name for each in parts])
    aside = np.array([-min(2.0 * reach + _GROUP_ROOM_M, 0.26), 0.0, 0.0])
    search = Search(solids, poses, contacts, aside)
    order = search.order(frozenset(base))
    if order is None:
        raise RuntimeError(_no_order(search, base))
    beside = any(np.linalg.norm(placing.at - poses[placing.moves[0]]) > _LOW_M for placing in order)
    site = site_of(reach, aside if beside else None)
    free = [each.name for each in parts if each.name not in base]
    turns = {part: poses[part][:3, :3] for part in free}
    stances = {part: stance(solids[part], R) for part, R in turns.items()}
    keep = [(np.array(site.center_m), reach + max(site.spread_m))]
    if beside:
        keep.append((np.array(site.center_m) + aside[:2], reach + max(site.spread_m)))
    starts = {part: poses[part] for part in base}
    for part, at in laid_out(solids, turns, site, keep).items():
        starts[part] = np.array(poses[part])
        starts[part][:3, 3] = (*at, stances[part].height_m)
    grasps, crowded = _holds(solids, poses, order, base)
    notes += crowded
    notes += _notes(solids, turns, stances, grasps)
    return Draft(
        tuple(PosedPart(each.name, each.file, each.solid, poses[each.name], each.color) for each in parts),
        base,
        why_fixed,
        order,
        starts,
        stances,
        grasps,
        site,
        clearance_mm,
        tuple(notes),
    )


def _base(parts: Sequence[PosedPart]) -> tuple[tuple[str, ...], str]:
    """The largest of the parts that lie on the table."""
    low = {each.name: extent(each.solid.pieces, each.T[2, :3])[0] + float(each.T[2, 3]) for each in parts}
    lowest = [each for each in parts if low[each.name] < min(low.values()) + _LOW_M]
    chosen = max(lowest, key=lambda each: each.solid.volume)
    return (chosen.name,), "the largest of those that lie lowest"


def _holds(
    solids: Mapping[str, Solid], poses: Poses, order: Sequence[Placing], base: Sequence[str]
) -> tuple[Mapping[str, Hold | None], list[str]]:
    """Where each part is held: the best place at which fingers have room beside what stands when it is put down.

    And what is to be said of parts that have no such place.
    """
    found: dict[str, Hold | None] = {}
    notes = list[str]()
    there = {*base}
    for placing in order:
        main = placing.moves[0]
        others = [part for part in there if part not in placing.moves]
        up = np.round(poses[main][2, :3], 9)
        offered = holds(solids[main], up, _OPENING_M)
        free = (
            hold
            for over, below in ((0.0, 0.0), (_OVER_M, _ROOM_M))
            for hold in holds(solids[main], up, _OPENING_M, over)[:_MOST_HOLDS]
            if not _struck(hold, below, poses[main], solids, poses, others)
        )
        found[main] = next(free, None)
        if offered and found[main] is None:
            found[main] = offered[0]
            notes.append(
                f"wherever a gripper holds '{main}', fingers that reach 10 mm below their tips meet what stands around "
                "its place; let it stand out higher, or give it a handle"
            )
        there |= set(placing.moves)
    return found, notes


def _struck(
    hold: Hold, below_m: float, T: Array, solids: Mapping[str, Solid], poses: Poses, others: Sequence[str]
) -> bool:
    """Whether a finger beside a part at T would be in one of the others, or so far below it."""
    up = T[2, :3]
    out = hold.half_width + _FINGER_M[0] - _ROOM_M
    high = 0.025 - below_m / 2
    half = np.add(_FINGER_M, (0.0, 0.0, below_m / 2))
    fingers = tuple(Box("", np.array([sign * out, 0.0, high]), half) for sign in (-1.0, 1.0))
    R = T[:3, :3] @ np.column_stack([hold.across, np.cross(up, hold.across), up])
    at = pose.apply(T, hold.point[None])
    return any(intrusion_depths(fingers, R, at, solids[part].pieces, poses[part])[0] > 0.0 for part in others)


def _notes(
    solids: Mapping[str, Solid],
    turns: Mapping[str, Array],
    stances: Mapping[str, Stance],
    grasps: Mapping[str, Hold | None],
) -> list[str]:
    found = list[str]()
    for part, R in turns.items():
        if not stances[part].stands:
            found.append(f"'{part}' needs turning over: it does not stand on the table as it is in the assembly")
        elif stances[part].rolls:
            found.append(f"'{part}' lies on a round wall at its start and may roll")
        if grasps[part] is None:
            size = " x ".join(f"{1e3 * np.ptp(extent(solids[part].pieces, R[i])):.4g}" for i in range(3))
            found.append(
                f"'{part}', {size} mm as it stands, offers no place to a gripper from above that opens to "
                f"{2e3 * _OPENING_M:g} mm"
            )
    return found


def _no_order(search: Search, base: Sequence[str]) -> str:
    stuck = [why for part, why in search.stuck.items() if part not in base]
    return _all(["there is no order in which these parts can be put together", *stuck])


def _all(sentences: Sequence[str]) -> str:
    return "; ".join(sentences) + "."
